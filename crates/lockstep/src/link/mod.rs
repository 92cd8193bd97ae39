//! Links: which sample of an output an input sees, and when.

mod schedule;
mod visibility;

pub use schedule::{Read, ReadSchedule};
pub use visibility::{Hold, Timing, TimingError, Visibility};
