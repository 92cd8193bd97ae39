//! Jobs of an engine: shards that are submitted together, and the request for their submission.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Shards that were submitted to an engine together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The engine's identifier of the job.
    pub(super) id: String,
    /// The shards in the order of the job's tasks.
    pub(super) shards: Vec<usize>,
}

/// A job to be submitted.
pub(super) struct JobRequest<'a> {
    /// The absolute path of the campaign's folder.
    pub(super) root: &'a Path,
    /// The campaign's name.
    pub(super) name: &'a str,
    /// The script that runs shard K as `SCRIPT K`.
    pub(super) script: PathBuf,
    /// The shards.
    pub(super) shards: &'a [usize],
    /// The user's options for the engine.
    pub(super) args: &'a [String],
}
