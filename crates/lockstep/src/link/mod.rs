//! Links: which sample of an output an input sees, and when.

mod conversion;
mod delivery_rule;
mod describe;
mod interpolation;
mod prepared;
mod schedule;

pub use conversion::{Conversion, Pair, Term};
pub use delivery_rule::{DeliveryRule, Hold, Timing, TimingError};
pub(crate) use interpolation::interpolate;
pub(crate) use prepared::PreparedConversion;
pub use schedule::{Read, ReadSchedule};
