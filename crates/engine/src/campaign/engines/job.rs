//! What an engine gets, and what it makes of it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Shards that were given to an engine at once.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// What the engine calls it.
    pub(super) id: String,
    /// The shards in the order of the job's tasks.
    pub(super) shards: Vec<usize>,
}

/// What an engine gets.
pub(super) struct Order<'a> {
    /// The campaign's folder, from the root on.
    pub(super) root: &'a Path,
    /// What the campaign is called.
    pub(super) name: &'a str,
    /// What runs shard K as `SCRIPT K`.
    pub(super) script: PathBuf,
    /// Which shards.
    pub(super) shards: &'a [usize],
    /// What the user says to the engine.
    pub(super) args: &'a [String],
}
