//! Measures: figures that a scenario declares, computed online from the samples.
//!
//! - [`Definition`]: a measure, with every name resolved;
//! - `window`: which samples count, in whole ticks; `pairing`: two streams at different rates;
//! - `signal`: from payloads to numbers; `compute`: from numbers to a figure; `limit`: from a figure to a criterion;
//! - [`of_tape`]: of a tape; [`Measures`]: all measures of a run; [`CombinedAssessment`]: combined with the assessment of a scenario.

mod compensated_sum;
mod compute;
mod limit;
mod measure;
mod pairing;
mod run;
mod signal;
mod tape;
mod together;
mod window;

pub use compute::{Absent, Compute, Found};
pub use limit::Limits;
pub use measure::Definition;
pub use run::Measures;
pub use signal::{Reading, Through};
pub use tape::{MeasureError, of_tape};
pub use together::CombinedAssessment;
