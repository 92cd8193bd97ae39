//! The executor of a run: all participants in one loop of this process, or each in its own process.

use std::collections::BTreeMap;

use lockstep::control::WallTimeBreakdown;
use lockstep::participant::PendingStep;
use lockstep::plan::Cut;
use lockstep::stepper::Stepper;
use lockstep::time::Ticks;

use super::failed::FailedParticipant;
use super::outcome::{Ending, RunFailure};
use super::state::RunState;
use crate::scenario::Entry;

/// The result of one turn.
pub(super) enum Turn {
    /// There is more to do.
    Continue,
    /// All participants are paused at this instant, where the clock controller stops.
    Paused(Ticks),
    /// The participant that is to be paused before its step has the inputs of its activation at this instant, and has not stepped.
    BeforeStep(Ticks),
    /// The run is over.
    Over(Ending),
    /// A step is to be done together with those of other runs.
    Parked,
}

/// What runs in a participant's slot when the run is resumed.
pub(super) enum Slot {
    /// The same program, with this state, or else the one that it has.
    Same(Option<Vec<u8>>),
    /// A new program, with this state, or else a cold start.
    New(Box<Entry>, Option<Vec<u8>>),
}

/// How the wall time of a run was spent.
#[derive(Default)]
pub(super) struct ExecutorReport {
    /// Of each participant.
    pub(super) timing: BTreeMap<String, WallTimeBreakdown>,
    /// The reason for the choice of cores, in words.
    pub(super) placement: String,
    /// The logs of participants, as far as they are in no file.
    pub(super) logs: BTreeMap<String, String>,
}

/// The participants of a run, and the loop or the processes that execute them.
pub(super) trait Executor {
    /// Lets the participants do a part of what the clock controller grants, and takes what they have recorded. The error is a failure
    /// from which the run may recover.
    fn turn(&mut self, run_state: &mut RunState) -> Result<Turn, Ending>;

    /// From now on steps are left to the caller if participants allow it: a turn then ends with [`Turn::Parked`].
    fn park(&mut self) {}

    /// The step that waits to be done, if one does.
    fn pending(&mut self) -> Option<PendingStep<'_>> {
        None
    }

    /// Whether all participants have done exactly the activations before `now`.
    fn has_reached(&self, now: Ticks) -> bool;

    /// The state of participant number `number`, which is paused.
    fn save(&mut self, run_state: &RunState, number: usize) -> Result<Vec<u8>, RunFailure>;

    /// While paused: fills the slots as `slots` says; all participants continue at `cut`. `rewind` says that this is another cut than
    /// the present one. Unconnected inputs have the values in the run state. Returns the participants that failed meanwhile.
    ///
    /// # Errors
    /// A failure that no participant caused; then no participant is left.
    fn continue_at(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
        rewind: bool,
    ) -> Result<Vec<FailedParticipant>, RunFailure>;

    /// While paused: gives unconnected inputs the values in the run state.
    fn apply_inputs(&mut self, run_state: &mut RunState, cut: &Cut) -> Result<Vec<FailedParticipant>, RunFailure>;

    /// Sets the instant that all participants have reached, after a checkpoint was restored.
    fn set_reached(&mut self, to: Ticks);

    /// Whether a participant can fail individually, so that others may continue without it.
    fn isolates_failures(&self) -> bool;

    /// Handles the failure in `ending` as the scenario specifies: returns when the run can continue, or returns the ending as an error.
    fn handle_failure(&mut self, run_state: &mut RunState, ending: Ending) -> Result<(), Ending>;

    /// Registers participants that failed while the run was resumed.
    fn register_failures(&mut self, failed_participants: Vec<FailedParticipant>);

    /// While paused: which process is which participant, in words.
    fn processes(&self) -> String;

    /// While paused: the failure of a participant that has ended or failed meanwhile.
    fn failure(&mut self, run_state: &RunState) -> Option<RunFailure>;

    /// Restarts the timeout within which participants must make progress.
    fn restart_timeout(&mut self);

    /// From now on turns stop before each step of participant number `number`. Returns the instant of the first such step, if
    /// participants can be paused there.
    fn pause_before_step(&mut self, number: usize) -> Option<Ticks> {
        let _ = number;
        None
    }

    /// From now on no participant is paused before its step.
    fn clear_step_pause(&mut self) {}

    /// The participant that is paused before its step.
    fn before_step(&self) -> Option<&Stepper> {
        None
    }

    /// Sets output number `output` of the participant that is paused before its step, in place of its step.
    fn set_output(&mut self, output: usize, payload: &[u8]) {
        let _ = (output, payload);
    }

    /// The newest log lines of a participant, if the executor itself collects them.
    fn newest_log(&self, participant: &str) -> Option<String> {
        let _ = participant;
        None
    }

    /// Commands all participants to terminate, and takes what they still have to record.
    fn shut_down(&mut self, run_state: &mut RunState);

    /// How wall time was spent.
    fn report(&self) -> ExecutorReport;
}
