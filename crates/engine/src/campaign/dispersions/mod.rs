//! Dispersions: each sets keys of the scenario to a value for every point.

mod column;
mod compatibility;
mod dispersion;
mod exact_times;
mod formula;
mod keys;
mod quantity;
mod read;
mod value_source;
mod vectors;

pub use dispersion::{DESIGNS, Design, Dispersion, Mode, Target};
pub use exact_times::unrounded_instants;
pub use formula::{DimensionedValue, Formula};
pub use quantity::{Quantity, at_key, keys_overlap};
pub use read::{Context, read_dispersion};
pub use value_source::{AttitudeFormat, SampledValue, ValueSource, label_of};
