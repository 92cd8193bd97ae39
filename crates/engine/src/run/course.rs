//! A run's own state, however its participants are executed: what sits in each seat, what has come in, and how far it may go.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lockstep::plan::{Cut, Plan, Position};
use lockstep::time::{Rational, Ticks};
use tape::folder::RunFolder;

use super::checkpoint::Checkpoint;
use super::horizon::Guide;
use super::inputs::Inputs;
use super::options::Options;
use super::outcome::{Ending, RunFailure};
use super::recording::Recorder;
use super::times::Times;
use crate::scenario::{Entry, Scenario};

/// The state of a run apart from its executor.
pub(super) struct Course {
    pub(super) scenario: Arc<Scenario>,
    pub(super) options: Options,
    pub(super) plan: Arc<Plan>,
    /// What runs in each seat.
    pub(super) entries: Vec<Entry>,
    /// How many of the scenario's substitutions have happened.
    pub(super) substituted: usize,
    /// The values of inputs that nobody feeds.
    pub(super) inputs: Inputs,
    /// How far everybody may go.
    pub(super) guide: Guide,
    /// Where the run leaves something, if it does.
    pub(super) folder: Option<RunFolder>,
    /// What the run goes back to when a participant is restarted.
    pub(super) last_checkpoint: Option<Checkpoint>,
    /// What became of participants that failed.
    pub(super) recovered: Vec<String>,
    pub(super) recorder: Arc<Mutex<Recorder>>,
    /// What participants say of their wall time.
    pub(super) times: Times,
}

impl Course {
    /// The recorder. Whoever has it lets go of it before anybody asks again.
    pub(super) fn recorder(&self) -> MutexGuard<'_, Recorder> {
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn time(&self, ticks: Ticks) -> Rational {
        self.plan.timebase.time(ticks).unwrap_or_default()
    }

    /// The newest stamp of anybody, ticks.
    pub(super) fn newest(&self) -> Ticks {
        self.recorder().newest
    }

    /// Tells what steers the run how far it is, whether all participants rest at the horizon, and how it keeps its pace.
    pub(super) fn tell(&mut self, newest: Ticks, resting: bool) {
        self.guide.tell(newest, resting);
        if let Some(steering) = &self.options.steering
            && let Some(news) = self.times.news()
        {
            steering.tell_pace(&news);
        }
    }

    /// The name of participant number `number`.
    pub(super) fn name(&self, number: usize) -> &str {
        &self.plan.participants[number].name
    }

    /// Where everybody goes on at `cut`, each with the state that it has.
    pub(super) fn positions(&self, cut: &Cut) -> Result<Vec<Position>, RunFailure> {
        let mut positions = self.recorder().positions(cut)?;
        self.inputs.put_into(&mut positions);
        Ok(positions)
    }

    /// How a failure of the run's own work ends it.
    pub(super) fn over(&self, failure: RunFailure) -> Ending {
        match failure {
            RunFailure::Participant { participant, reason } => Ending::Failed { participant, reason },
            RunFailure::Interrupted => Ending::Stopped {
                reason: format!(
                    "interrupted at t = {} s",
                    self.plan.timebase.seconds(self.newest().max(0))
                ),
            },
            other => Ending::own(other.to_string()),
        }
    }
}
