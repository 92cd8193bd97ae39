//! Why there is no campaign.

use std::path::PathBuf;

use super::cases::CasesError;
use super::grid::GridError;
use crate::run::RunFailure;
use crate::scenario::ScenarioError;

/// Why there is no campaign, or no more of it.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The scenario, or the first point of it, is wrong.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The list of cases is wrong.
    #[error(transparent)]
    Cases(#[from] CasesError),
    /// What shall be varied makes no sense.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A number of points that there cannot be.
    #[error("--points: {0}")]
    Points(String),
    /// The folder belongs to something else.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why it is not taken.
        reason: String,
    },
    /// A rare event cannot be looked for.
    #[error("{0}")]
    Rare(String),
    /// Folders of shards do not make a whole.
    #[error("{0}")]
    Merge(String),
    /// The engine is not there, or does not do it.
    #[error("--on {engine}: {reason}")]
    Engine {
        /// Which one.
        engine: &'static str,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// The figure is not there.
    #[error("there is no figure of merit `{name}`; there is {known}")]
    Figure {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// The scenario has changed under the campaign.
    #[error("{} has changed since the campaign began: start it again", path.display())]
    Changed {
        /// The scenario.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The table cannot be written.
    #[error(transparent)]
    Export(#[from] report::export::ExportError),
    /// A run cannot be started.
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
