//! Dispatch of each request to the selected engine.

use std::collections::BTreeSet;

use super::engine::Engine;
use super::job::{Job, Order};
use super::{hyperqueue, slurm};
use crate::campaign::CampaignError;

impl Engine {
    /// The version of the installed engine.
    ///
    /// # Errors
    /// When the engine is not installed.
    pub fn version(self) -> Result<String, CampaignError> {
        match self {
            Engine::Shell => Ok("shell".to_owned()),
            Engine::Slurm => slurm::version(),
            Engine::Hyperqueue => hyperqueue::version(),
        }
    }

    /// Maximum number of shards of one job.
    pub(super) fn at_once(self) -> Result<usize, CampaignError> {
        match self {
            Engine::Shell | Engine::Hyperqueue => Ok(usize::MAX),
            Engine::Slurm => slurm::array_max(),
        }
    }

    pub(super) fn start(self, order: &Order<'_>) -> Result<Job, CampaignError> {
        let id = match self {
            // The user starts the command lines.
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
    pub(super) fn alive(self, job: &Job, args: &[String]) -> Result<BTreeSet<usize>, CampaignError> {
        match self {
            Engine::Shell => Ok(BTreeSet::new()),
            Engine::Slurm => slurm::alive(job),
            Engine::Hyperqueue => hyperqueue::alive(job, args),
        }
    }
}
