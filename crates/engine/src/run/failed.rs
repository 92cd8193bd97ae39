//! Participants that failed, and how often.

use super::outcome::RunFailure;
use super::state::RunState;

/// How often a participant may fail without making any progress.
pub(super) const RESTARTS_MAX: u32 = 5;

/// A participant that failed.
#[derive(Debug, Clone)]
pub(super) struct FailedParticipant {
    /// Its number in the plan.
    pub(super) number: usize,
    /// The reason, in words that follow its name.
    pub(super) reason: String,
}

impl FailedParticipant {
    /// The participant that caused `failure`; a failure without a participant is returned as an error.
    pub(super) fn of(run_state: &RunState, failure: RunFailure) -> Result<FailedParticipant, RunFailure> {
        let (participant, reason) = match failure {
            RunFailure::Participant { participant, reason } => (participant, reason),
            other => return Err(other),
        };
        match run_state.plan.participant(&participant) {
            Some(number) => Ok(FailedParticipant { number, reason }),
            None => Err(RunFailure::Participant { participant, reason }),
        }
    }

    pub(super) fn first_line(&self) -> &str {
        self.reason.lines().next().unwrap_or_default()
    }
}

/// How often a participant failed without getting beyond `furthest`.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Restarts {
    pub(super) furthest: u64,
    pub(super) count: u32,
}
