//! Exact time: rational numbers for users, integer ticks for the plan.

mod rational;
mod sample_time;

pub use rational::{Rational, TimeError};
pub(crate) use rational::{gcd, nearest_double};
pub use sample_time::{SampleTime, TickError, Ticks, Timebase};
