//! Dispersions: each sets keys of the scenario to a value for every point.

mod column;
mod dispersion;
mod draws;
mod fit;
mod formula;
mod keys;
mod quantity;
mod read;
mod vectors;

pub use dispersion::{DESIGNS, Design, Dispersion, Mode, Target};
pub use draws::{Drawn, Draws, Frame, plain};
pub use formula::{Formula, Sized};
pub use quantity::{Quantity, at_key, by_names, near};
pub use read::{Context, dispersion};
