//! How a campaign is run.

use std::path::PathBuf;

use super::Number;
use super::keep::Keep;
use super::shard::Shard;
use super::until::Watch;
use crate::observer::{Interrupt, Progress};

/// What the command line says about a campaign besides its points.
#[derive(Clone, Default)]
pub struct Options {
    /// The campaign's folder; one named after the scenario and the points unless given.
    pub out: Option<PathBuf>,
    /// Processes that work side by side; one a core unless given.
    pub workers: Option<usize>,
    /// Points side by side in the lanes of each worker's processor; as many as are good for this machine unless given.
    pub lanes: Option<usize>,
    /// The points whose run folders are kept.
    pub keep: Vec<Keep>,
    /// The figure of merit by which points are the worst; the criteria unless given.
    pub figure: Option<Number>,
    /// Run a part of the points alone.
    pub shard: Option<Shard>,
    /// Which share of all points is run twice, in two shards.
    pub audit: f64,
    /// End as soon as this knows enough.
    pub until: Option<Watch>,
    /// Whether the same campaign with more points has the same folder, unless the user names one.
    pub grows: bool,
    /// Receives what happens.
    pub progress: Progress,
    /// Asks for an end in order.
    pub interrupt: Interrupt,
}
