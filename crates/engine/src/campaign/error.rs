//! Errors of campaigns.

use std::path::PathBuf;

use super::cases::CasesError;
use super::grid::GridError;
use crate::run::RunFailure;
use crate::scenario::ScenarioError;

/// Why a campaign was not started, or was ended.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The scenario, or its first point, is invalid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The list of cases is invalid.
    #[error(transparent)]
    Cases(#[from] CasesError),
    /// The keys and values to be varied are invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// An impossible number of points.
    #[error("--points: {0}")]
    Points(String),
    /// The folder belongs to something else.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why it is rejected.
        reason: String,
    },
    /// A point cannot be drawn.
    #[error("point {point} cannot be run: {reason}")]
    Impossible {
        /// From 1.
        point: usize,
        /// Why.
        reason: String,
    },
    /// The points cannot end early.
    #[error("--until: {0}")]
    Until(String),
    /// The search for a rare event is not possible.
    #[error("{0}")]
    Rare(String),
    /// Folders of shards do not form one complete campaign.
    #[error("{0}")]
    Merge(String),
    /// The engine is not installed, or reports an error.
    #[error("--on {engine}: {reason}")]
    Engine {
        /// The engine.
        engine: &'static str,
        /// The mistake, and the remedy.
        reason: String,
    },
    /// The figure does not exist.
    #[error("there is no figure of merit `{name}`; there is {known}")]
    Figure {
        /// The requested name.
        name: String,
        /// The existing names.
        known: String,
    },
    /// The scenario has changed since the campaign began.
    #[error("{} has changed since the campaign began: start it again", path.display())]
    Changed {
        /// The scenario.
        path: PathBuf,
    },
    /// An error of the file system.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted operation.
        action: &'static str,
        /// The system's message.
        source: std::io::Error,
    },
    /// The table cannot be written.
    #[error(transparent)]
    Export(#[from] report::export::ExportError),
    /// A worker process cannot be started.
    #[error(transparent)]
    Run(#[from] RunFailure),
}

impl CampaignError {
    /// The exit code of the program: 2 when the user must change something, else 1.
    pub fn exit_code(&self) -> i32 {
        match self {
            CampaignError::Io { .. }
            | CampaignError::Export(_)
            | CampaignError::Changed { .. }
            | CampaignError::Engine { .. } => 1,
            CampaignError::Run(failure) => failure.exit_code(),
            _ => 2,
        }
    }
}
