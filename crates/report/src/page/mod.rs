//! The report: one self-contained HTML page about one run or several, and its figures as files.
//!
//! The page needs no network, no server and no other file. It draws every field of every stream, and before them the
//! figures that the scenario's table `[report]` and the program's own views define ([`crate::view`]). Its size is bounded
//! whatever the length of the run: a curve of more than 8192 samples is thinned to the least and greatest sample of each of
//! 2048 buckets, the fields of a tape with hundreds of them to fewer, and the playback to 3000 instants.

mod budget;
mod document;
mod error;
mod files;
mod live;
mod motion;
mod plans;
mod report;
mod resampled;
mod run;
mod series;
mod summary;
mod times;
mod views;

pub(crate) use document::{STYLE, TICKS, TOOLS, base64, fill_template};
pub use error::ReportError;
pub use files::{PlanFile, read_json};
pub use live::Live;
pub use report::Report;
pub use run::Request;
pub(crate) use series::Series;
pub use summary::split_unit;
pub use views::scene_of;
