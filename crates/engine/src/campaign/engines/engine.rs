//! The supported engines.

use std::process::{Command, Output};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::campaign::CampaignError;

/// An engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Engine {
    /// Prints one command line per shard, for any system that runs command lines.
    Shell,
    /// `sbatch --array`
    Slurm,
    /// The Python package `hyperqueue`.
    Hyperqueue,
}

impl FromStr for Engine {
    type Err = String;

    fn from_str(text: &str) -> Result<Engine, String> {
        match text {
            "shell" => Ok(Engine::Shell),
            "slurm" => Ok(Engine::Slurm),
            "hyperqueue" => Ok(Engine::Hyperqueue),
            _ => Err(format!(
                "there is no engine `{text}`; there is shell, slurm and hyperqueue"
            )),
        }
    }
}

impl Engine {
    /// The name as `--on` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Engine::Shell => "shell",
            Engine::Slurm => "slurm",
            Engine::Hyperqueue => "hyperqueue",
        }
    }

    pub(super) fn refuse<T>(self, reason: impl std::fmt::Display) -> Result<T, CampaignError> {
        Err(CampaignError::Engine {
            engine: self.name(),
            reason: reason.to_string(),
        })
    }

    /// Runs a command of the engine to completion.
    pub(super) fn run_command(self, command: &mut Command, remedy: &str) -> Result<Output, CampaignError> {
        command.output().or_else(|error| {
            let program = command.get_program().to_string_lossy().into_owned();
            self.refuse(format!("`{program}` cannot be started ({error}): {remedy}"))
        })
    }
}

/// The last lines of a command's output.
pub(super) fn last_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.next_back().unwrap_or("it says nothing").to_owned()
}
