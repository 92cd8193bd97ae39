//! Dispatch of each request to the selected engine.

use std::collections::BTreeSet;

use super::engine::Engine;
use super::job::{Job, JobRequest};
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
    pub(super) fn job_size_max(self) -> Result<usize, CampaignError> {
        match self {
            Engine::Shell | Engine::Hyperqueue => Ok(usize::MAX),
            Engine::Slurm => slurm::array_max(),
        }
    }

    pub(super) fn start(self, request: &JobRequest<'_>) -> Result<Job, CampaignError> {
        let id = match self {
            // The user starts the command lines.
            Engine::Shell => String::new(),
            Engine::Slurm => slurm::start(request)?,
            Engine::Hyperqueue => hyperqueue::start(request)?,
        };
        Ok(Job {
            id,
            shards: request.shards.to_vec(),
        })
    }

    /// The shards of `job` that wait or run, as far as the engine knows.
    pub(super) fn active_shards(self, job: &Job, args: &[String]) -> Result<BTreeSet<usize>, CampaignError> {
        match self {
            Engine::Shell => Ok(BTreeSet::new()),
            Engine::Slurm => slurm::active_shards(job),
            Engine::Hyperqueue => hyperqueue::active_shards(job, args),
        }
    }
}
