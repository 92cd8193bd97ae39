//! Views of a report, independent of any run: figures of signals, with limits and marks.
//!
//! A [`View`] comes from the table `[report]` of a scenario ([`View::read`]), or from a program that knows which figures
//! its application needs. Fields that it leaves out are still on the page: each field of each stream has a figure of its
//! own.

mod bind;
mod evaluate;
mod every;
mod figure;
mod limits;
mod mistake;
mod prefix;
mod read;
mod signal;

pub(crate) use bind::{Axis, Binding, BoundFigure, BoundFigures, bind};
pub(crate) use every::{every_field, omitted_fields_note};
pub use figure::{Computed, Curve, Figure, Formula, Line, Unit, View, Views};
pub(crate) use limits::{Limit, limits_of};
pub use mistake::Mistake;
pub(crate) use prefix::best;
pub(crate) use read::below;
pub use signal::Signal;
