//! The context of a scenario: the builtins of the program, and the file, for the lines of mistakes and for relative paths.

use std::path::PathBuf;
use std::sync::Arc;

use super::error::{Mistake, ScenarioError};
use super::spec::Origin;
use crate::builtins::Builtins;

/// The context of a scenario.
#[derive(Clone)]
pub(super) struct SourceContext {
    pub(super) builtins: Arc<Builtins>,
    pub(super) origin: Origin,
    /// The folder that relative paths are relative to.
    pub(super) folder: PathBuf,
}

impl SourceContext {
    /// The absolute folder; `None` when there is no current folder.
    pub(super) fn folder_in_full(&self) -> Option<PathBuf> {
        std::path::absolute(self.folder.join(".")).ok()
    }

    /// A mistake about `key`, with its line, or with the change that made it.
    pub(super) fn mistake(&self, key: &str, reason: impl Into<String>) -> Mistake {
        self.origin.mistake(key, reason)
    }

    pub(super) fn error(&self, mistakes: Vec<Mistake>) -> ScenarioError {
        self.origin.error(mistakes)
    }
}
