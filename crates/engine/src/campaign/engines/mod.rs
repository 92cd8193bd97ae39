//! Engines that run the shards of a campaign on other machines.
//!
//! An engine starts `shard.sh K` somewhere, for each shard K that is missing. What it makes of that is in the shards' folders: an engine that
//! loses a shard, runs it twice or forgets everything changes no result.

mod hyperqueue;
mod slurm;
mod submit;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::CampaignError;

pub use submit::{Cluster, Step, Waiting, submit, waiting};

/// An engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Engine {
    /// One command line a shard, for whatever runs command lines.
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

/// Shards that were given to an engine at once.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Job {
    /// What the engine calls it.
    id: String,
    /// The shards in the order of the job's tasks.
    shards: Vec<usize>,
}

/// What an engine gets.
struct Order<'a> {
    /// The campaign's folder, from the root on.
    root: &'a Path,
    /// What the campaign is called.
    name: &'a str,
    /// What runs shard K as `SCRIPT K`.
    script: PathBuf,
    /// Which shards.
    shards: &'a [usize],
    /// What the user says to the engine.
    args: &'a [String],
}

impl Engine {
    /// The name as `--on` takes it.
    pub fn word(self) -> &'static str {
        match self {
            Engine::Shell => "shell",
            Engine::Slurm => "slurm",
            Engine::Hyperqueue => "hyperqueue",
        }
    }

    fn refuse<T>(self, reason: impl std::fmt::Display) -> Result<T, CampaignError> {
        Err(CampaignError::Engine {
            engine: self.word(),
            reason: reason.to_string(),
        })
    }

    /// The version of the engine that is found.
    ///
    /// # Errors
    /// When there is none.
    pub fn version(self) -> Result<String, CampaignError> {
        match self {
            Engine::Shell => Ok("shell".to_owned()),
            Engine::Slurm => slurm::version(),
            Engine::Hyperqueue => hyperqueue::version(),
        }
    }

    /// At most so many shards go into one job.
    fn at_once(self) -> Result<usize, CampaignError> {
        match self {
            Engine::Shell | Engine::Hyperqueue => Ok(usize::MAX),
            Engine::Slurm => slurm::array_max(),
        }
    }

    fn start(self, order: &Order<'_>) -> Result<Job, CampaignError> {
        let id = match self {
            // The user starts them.
            Engine::Shell => String::new(),
            Engine::Slurm => slurm::start(order)?,
            Engine::Hyperqueue => hyperqueue::start(order)?,
        };
        Ok(Job {
            id,
            shards: order.shards.to_vec(),
        })
    }

    /// The shards of `job` that wait or run, as far as the engine knows.
    fn alive(self, job: &Job, args: &[String]) -> Result<BTreeSet<usize>, CampaignError> {
        match self {
            Engine::Shell => Ok(BTreeSet::new()),
            Engine::Slurm => slurm::alive(job),
            Engine::Hyperqueue => hyperqueue::alive(job, args),
        }
    }

    /// Runs a command of the engine to its end.
    fn call(self, command: &mut Command, remedy: &str) -> Result<Output, CampaignError> {
        command.output().or_else(|error| {
            let program = command.get_program().to_string_lossy().into_owned();
            self.refuse(format!("`{program}` cannot be started ({error}): {remedy}"))
        })
    }
}

/// The last words of a command.
fn last_words(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.next_back().unwrap_or("it says nothing").to_owned()
}
