//! Content of `modelDescription.xml`, in the same terms for FMI 2.0 and 3.0.

mod content;
mod experiment;
mod literals;
mod nodes;
mod read;
mod units;
mod variable;

pub use content::{Capabilities, Description, Experiment, Version};
pub use read::DescriptionError;
pub use units::{BASE as BASE_UNITS, BaseUnit, Conversion, Unit};
pub use variable::{Alias, Causality, Extent, Initial, Item, Range, Type, Variability, Variable};
