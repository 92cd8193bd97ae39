//! What a run leaves behind: the tape, the run folder, comparisons, exports and reports.
//!
//! - [`tape`]: the bit-exact record of every sample, written while the run goes on and readable after any crash;
//! - [`folder`]: where the files of one run lie;
//! - [`compare`]: whether two tapes are the same bits, and where they part;
//! - [`export`]: CSV, Parquet and MCAP;
//! - [`figures`]: charts and maps as SVG and PNG;
//! - [`report`]: figures and 3-D playback in one page, with the shapes of [`geometry`].
//!
//! The crate knows ports only by their [`lockstep::port::Descriptor`]: every field has a name, a shape, a unit and a
//! frame, and nothing here needs the type that produced it.

pub mod compare;
pub mod export;
pub mod figures;
pub mod folder;
pub mod geometry;
pub mod report;
pub mod tape;
