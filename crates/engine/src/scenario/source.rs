//! What a scenario is made of: the parts of the program, and the place of the file, where the lines of mistakes are and relative paths lead.

use std::path::PathBuf;
use std::sync::Arc;

use super::error::{Mistake, ScenarioError};
use super::spec::Origin;
use crate::builtins::Builtins;

/// The surroundings of a scenario.
#[derive(Clone)]
pub(super) struct Source {
    pub(super) builtins: Arc<Builtins>,
    pub(super) origin: Origin,
    /// The folder that relative paths are relative to.
    pub(super) folder: PathBuf,
}

impl Source {
    /// The folder from the root on; `None` when there is no current folder.
    pub(super) fn folder_in_full(&self) -> Option<PathBuf> {
        std::path::absolute(self.folder.join(".")).ok()
    }

    /// A mistake about `key`, with the line it stands on, or with the change that made it.
    pub(super) fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        self.origin.mistake(key, reason)
    }

    pub(super) fn error(&self, mistakes: Vec<Mistake>) -> ScenarioError {
        self.origin.error(mistakes)
    }
}
