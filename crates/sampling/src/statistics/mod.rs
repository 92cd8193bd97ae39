//! Statistics of samples, none of which assumes a distribution.

mod indices;
mod moments;
mod order;
mod ranks;

pub use indices::{Index, indices};
pub use moments::moments;
pub use order::{Percentile, percentile, rank_bounds};
pub use ranks::{correlation, ranks, spearman};
