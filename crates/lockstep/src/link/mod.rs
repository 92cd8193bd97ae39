//! Links: which sample of an output an input sees, and when.

mod conversion;
mod interpolation;
mod joined;
mod schedule;
mod visibility;
mod words;

pub use conversion::{Conversion, Pair, Term};
pub(crate) use interpolation::interpolate;
pub(crate) use joined::Joined;
pub use schedule::{Read, ReadSchedule};
pub use visibility::{Hold, Timing, TimingError, Visibility};
