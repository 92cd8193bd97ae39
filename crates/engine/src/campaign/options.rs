//! Options of a campaign: everything but its points, from the folder to the stopping rule.

use std::path::PathBuf;

use super::Number;
use super::folder::keep::Keep;
use super::shards::shard::Shard;
use super::stopping_rule::{Until, Watch};
use crate::observer::{Interrupt, Progress};

/// The options of the command line for a campaign, besides its points.
#[derive(Clone, Default)]
pub struct Options {
    /// The campaign's folder; unless given, one named after the scenario and the points.
    pub out: Option<PathBuf>,
    /// Number of worker processes; one per core unless given.
    pub workers: Option<usize>,
    /// Number of points side by side in the SIMD lanes of each worker's core; unless given, the number that is efficient on
    /// this machine.
    pub lanes: Option<usize>,
    /// The points whose run folders are kept.
    pub keep: Vec<Keep>,
    /// The figure of merit that ranks points for the worst; the criteria unless given.
    pub figure: Option<Number>,
    /// Run only this shard of the points.
    pub shard: Option<Shard>,
    /// The share of all points that is run twice, in two shards.
    pub audit: f64,
    /// End as soon as this figure is known accurately enough.
    pub until: Option<Watch>,
    /// Whether the same campaign with more points uses the same folder, unless the user names one.
    pub grows: bool,
    /// Receives progress events.
    pub progress: Progress,
    /// Requests an orderly end.
    pub interrupt: Interrupt,
}

impl Options {
    /// The stopping rule.
    pub(super) fn stopping_rule(&self) -> Option<Until> {
        self.until.as_ref().map(|watch| watch.until().clone())
    }
}
