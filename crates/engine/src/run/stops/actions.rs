//! Actions while all participants are paused: checkpoints, substitutions, pauses.

use lockstep::plan::Cut;
use lockstep::time::{Rational, Ticks};

use super::schedule::Action;
use crate::run::executor::{Executor, Slot};
use crate::run::failed::FailedParticipant;
use crate::run::outcome::{Ending, RunFailure};
use crate::run::prepare;
use crate::run::saved::checkpoint::Checkpoint;
use crate::run::state::RunState;
use crate::scenario::State;

/// Performs what the schedule has for `now`, at which all participants are paused. Returns `Some` when the run is over. An error is a
/// failure from which the run may recover; the action that was not performed is then still on the schedule.
pub(crate) fn perform_actions(
    executor: &mut dyn Executor,
    run_state: &mut RunState,
    now: Ticks,
) -> Result<Option<Ending>, Ending> {
    while let Some(action) = run_state.clock.take(now) {
        let done = match action {
            Action::Checkpoint { file } => checkpoint(executor, run_state, now, file).map(|()| Vec::new()),
            Action::Substitute(number) => substitute(executor, run_state, now, number),
            Action::Pause => match pause(executor, run_state, now) {
                Ok(false) => {
                    let t = run_state.plan.timebase.seconds(now);
                    let reason = format!("stopped at t = {t} s");
                    return Ok(Some(Ending::Stopped { reason }));
                }
                other => other.map(|_| Vec::new()),
            },
        };
        let failed_participants = done.map_err(|failure| {
            run_state.clock.put_back(now, action);
            run_state.ending_of(failure)
        })?;
        executor.restart_timeout();
        report_failures(executor, run_state, failed_participants)?;
        if !executor.has_reached(now) {
            // The participants were moved and have to reach this stop again.
            break;
        }
    }
    Ok(None)
}

/// Reports the failure of `failed_participants`, without which the run was resumed, as an ending from which the run may recover.
pub(crate) fn report_failures(
    executor: &mut dyn Executor,
    run_state: &RunState,
    failed_participants: Vec<FailedParticipant>,
) -> Result<(), Ending> {
    let Some(first) = failed_participants.first() else {
        return Ok(());
    };
    let ending = Ending::Failed {
        participant: run_state.name(first.number).to_owned(),
        reason: first.reason.clone(),
    };
    executor.register_failures(failed_participants);
    Err(ending)
}

/// The state of the run, with all participants paused at `cut`.
pub(crate) fn collect_checkpoint<E: Executor + ?Sized>(
    executor: &mut E,
    run_state: &RunState,
    time: Rational,
    cut: Cut,
) -> Result<Checkpoint, RunFailure> {
    let states = (0..run_state.entries.len()).map(|number| executor.save(run_state, number));
    let states = states.collect::<Result<_, _>>()?;
    let off_tape = run_state.recorder().off_tape_state(&cut)?;
    let checkpoint = Checkpoint::new(
        &run_state.plan,
        time,
        cut,
        states,
        run_state.substituted,
        &run_state.entries,
    );
    Ok(Checkpoint { off_tape, ..checkpoint })
}

/// Saves the state at `time`, where all participants have just continued at `cut`, so that a restart need not go back further.
/// Returns the participant that failed meanwhile, if one did.
pub(crate) fn save_for_restarts<E: Executor + ?Sized>(
    executor: &mut E,
    run_state: &mut RunState,
    time: Rational,
    cut: Cut,
) -> Result<Option<FailedParticipant>, RunFailure> {
    if !executor.isolates_failures() || !run_state.scenario.restarts() {
        return Ok(None);
    }
    match collect_checkpoint(executor, run_state, time, cut) {
        Ok(checkpoint) => {
            run_state.last_checkpoint = Some(checkpoint);
            Ok(None)
        }
        Err(failure) => FailedParticipant::of(run_state, failure).map(Some),
    }
}

fn checkpoint(executor: &mut dyn Executor, run_state: &mut RunState, now: Ticks, file: bool) -> Result<(), RunFailure> {
    // Where participants cannot fail individually, none is restarted.
    if !file && !executor.isolates_failures() {
        return Ok(());
    }
    let cut = run_state.recorder().cut_at(now);
    let checkpoint = collect_checkpoint(executor, run_state, run_state.time(now), cut)?;
    if let (true, Some(folder)) = (file, &run_state.folder) {
        // The tape first: a checkpoint is of no use without the samples before it.
        run_state.recorder().flush()?;
        checkpoint.write(&folder.checkpoints())?;
    }
    run_state.last_checkpoint = Some(checkpoint);
    Ok(())
}

/// The substitution number `number` of the scenario, at `now`.
fn substitute(
    executor: &mut dyn Executor,
    run_state: &mut RunState,
    now: Ticks,
    number: usize,
) -> Result<Vec<FailedParticipant>, RunFailure> {
    let substitution = &run_state.scenario.substitutions[number];
    let (slot, how, entry) = (substitution.participant, substitution.state, substitution.entry.clone());
    let state = match how {
        State::Cold => None,
        State::Keep => Some(executor.save(run_state, slot)?),
    };
    let cut = run_state.recorder().cut_at(now);
    let event = prepare::substitution_event(&run_state.plan, now, &cut, slot, &entry, how);
    let mut new = Some((entry, state));
    let slots = (0..run_state.entries.len())
        .map(|number| match new.take_if(|_| number == slot) {
            Some((entry, state)) => Slot::New(Box::new(entry), state),
            None => Slot::Same(None),
        })
        .collect();
    let mut failed_participants = executor.continue_at(run_state, &cut, slots, false)?;
    run_state.substituted = number + 1;
    {
        let mut recorder = run_state.recorder();
        recorder.producer_replaced(slot);
        recorder.event(&event)?;
    }
    if failed_participants.is_empty() {
        failed_participants.extend(save_for_restarts(executor, run_state, run_state.time(now), cut)?);
    }
    Ok(failed_participants)
}

/// Waits for the user; returns whether the run continues.
fn pause(executor: &mut dyn Executor, run_state: &mut RunState, now: Ticks) -> Result<bool, RunFailure> {
    // Readers of the tape now see everything before the pause.
    run_state.recorder().flush()?;
    let steering = run_state.clock.begin_pause(now);
    let (processes, options) = (executor.processes(), &run_state.options);
    let continues = prepare::wait_while_paused(
        &run_state.plan,
        now,
        &processes,
        &options.progress,
        &options.interrupt,
        steering.as_deref(),
        || executor.failure(run_state),
    );
    run_state.clock.resume();
    continues
}
