//! Distribution-free statistics of samples.

mod indices;
mod moments;
mod order;
mod ranks;
mod share;

pub use indices::{Index, indices};
pub use moments::moments;
pub use order::{Percentile, nearest_rank, percentile, rank_bounds};
pub use ranks::{correlation, ranks, spearman};
pub use share::{NORMAL_95, wilson};
