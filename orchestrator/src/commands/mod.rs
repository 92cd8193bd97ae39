//! One file per command; each returns the exit code.

pub mod bench;
pub mod check;
mod cluster;
pub mod compare;
pub mod completions;
mod conclusion;
pub mod doctor;
pub mod export;
pub mod faults;
pub mod fmu;
pub mod fmu_export;
#[cfg(feature = "capture")]
mod gains;
pub mod graph;
pub mod import;
pub mod man;
#[cfg(feature = "capture")]
pub mod margins;
pub mod measure;
#[cfg(feature = "capture")]
pub mod model;
pub mod new;
mod outputs;
pub mod participant;
mod points;
pub mod project;
pub mod replay;
pub mod report;
pub mod resume;
pub mod run;
mod seal;
pub mod shards;
pub mod sweep;
#[cfg(feature = "capture")]
pub mod tune;
