//! The run state that both executors share: what runs in each slot, what has been recorded, and how far the run may go.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lockstep::plan::{Cut, Plan, Position};
use lockstep::time::{Rational, Ticks};
use tape::folder::RunFolder;

use super::inputs::Inputs;
use super::options::Options;
use super::outcome::{Ending, RunFailure};
use super::pace::clock_controller::ClockController;
use super::pace::spans::SpanAnalysis;
use super::recording::recorder::Recorder;
use super::saved::checkpoint::Checkpoint;
use crate::scenario::{Entry, Scenario};

/// The state of a run apart from its executor.
pub(super) struct RunState {
    pub(super) scenario: Arc<Scenario>,
    pub(super) options: Options,
    pub(super) plan: Arc<Plan>,
    /// What runs in each slot.
    pub(super) entries: Vec<Entry>,
    /// How many of the scenario's substitutions have taken place.
    pub(super) substituted: usize,
    /// The values of unconnected inputs.
    pub(super) inputs: Inputs,
    /// How far all participants may go.
    pub(super) clock: ClockController,
    /// The run folder, if the run has one.
    pub(super) folder: Option<RunFolder>,
    /// The checkpoint to which the run goes back when a participant is restarted.
    pub(super) last_checkpoint: Option<Checkpoint>,
    /// How failures of participants were handled so far.
    pub(super) recovered: Vec<String>,
    pub(super) recorder: Arc<Mutex<Recorder>>,
    /// The spans of wall time that participants report.
    pub(super) span_analysis: SpanAnalysis,
}

impl RunState {
    /// Locks the recorder. The guard must be dropped before the next call.
    pub(super) fn recorder(&self) -> MutexGuard<'_, Recorder> {
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn time(&self, ticks: Ticks) -> Rational {
        self.plan.timebase.time(ticks).unwrap_or_default()
    }

    /// The newest stamp of any sample, ticks.
    pub(super) fn newest(&self) -> Ticks {
        self.recorder().newest
    }

    /// Reports to the external control how far the run is, whether all participants are paused at the horizon, and the pace so far.
    pub(super) fn report_progress(&mut self, newest: Ticks, resting: bool) {
        self.clock.report_progress(newest, resting);
        if let Some(steering) = &self.options.steering
            && let Some(update) = self.span_analysis.pace_update()
        {
            steering.report_pace(&update);
        }
    }

    /// The name of participant number `number`.
    pub(super) fn name(&self, number: usize) -> &str {
        &self.plan.participants[number].name
    }

    /// Where all participants continue at `cut`, each with the state that it has.
    pub(super) fn positions(&self, cut: &Cut) -> Result<Vec<Position>, RunFailure> {
        let mut positions = self.recorder().positions(cut)?;
        self.inputs.put_into(&mut positions);
        Ok(positions)
    }

    /// The ending that a failure of the run's own work causes.
    pub(super) fn ending_of(&self, failure: RunFailure) -> Ending {
        match failure {
            RunFailure::Participant { participant, reason } => Ending::Failed { participant, reason },
            RunFailure::Interrupted => Ending::Stopped {
                reason: format!(
                    "interrupted at t = {} s",
                    self.plan.timebase.seconds(self.newest().max(0))
                ),
            },
            other => Ending::orchestrator_failed(other.to_string()),
        }
    }
}
