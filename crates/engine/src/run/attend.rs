//! Actions while all participants rest: checkpoints, substitutions, pauses.

use lockstep::plan::Cut;
use lockstep::time::{Rational, Ticks};

use super::agenda::Business;
use super::checkpoint::Checkpoint;
use super::course::Course;
use super::executor::{Executor, Seat};
use super::fallen::Fallen;
use super::outcome::{Ending, RunFailure};
use super::prepare;
use crate::scenario::State;

/// Performs what the agenda has for `now`, at which all participants rest. Returns `Some` when the run is over. An error is a
/// failure that the run may survive; the action that was not performed is then still on the agenda.
pub(super) fn attend(executor: &mut dyn Executor, course: &mut Course, now: Ticks) -> Result<Option<Ending>, Ending> {
    while let Some(business) = course.guide.take(now) {
        let done = match business {
            Business::Checkpoint { file } => checkpoint(executor, course, now, file).map(|()| Vec::new()),
            Business::Substitute(number) => substitute(executor, course, now, number),
            Business::Pause => match pause(executor, course, now) {
                Ok(false) => {
                    let t = course.plan.timebase.seconds(now);
                    let reason = format!("stopped at t = {t} s");
                    return Ok(Some(Ending::Stopped { reason }));
                }
                other => other.map(|_| Vec::new()),
            },
        };
        let fallen = done.map_err(|failure| {
            course.guide.put_back(now, business);
            course.over(failure)
        })?;
        executor.renew_patience();
        fell(executor, course, fallen)?;
        if !executor.rests_at(now) {
            // The participants were moved and have to reach this rest again.
            break;
        }
    }
    Ok(None)
}

/// Reports the failure of `fallen`, without which the run was taken up, as an ending that the run may survive.
pub(super) fn fell(executor: &mut dyn Executor, course: &Course, fallen: Vec<Fallen>) -> Result<(), Ending> {
    let Some(first) = fallen.first() else { return Ok(()) };
    let ending = Ending::Failed {
        participant: course.name(first.number).to_owned(),
        reason: first.reason.clone(),
    };
    executor.note_fallen(fallen);
    Err(ending)
}

/// The state of the run, with all participants at rest at `cut`.
pub(super) fn saved<E: Executor + ?Sized>(
    executor: &mut E,
    course: &Course,
    time: Rational,
    cut: Cut,
) -> Result<Checkpoint, RunFailure> {
    let states = (0..course.entries.len()).map(|number| executor.save(course, number));
    let states = states.collect::<Result<_, _>>()?;
    let rest = course.recorder().rest(&cut)?;
    let checkpoint = Checkpoint::new(&course.plan, time, cut, states, course.substituted, &course.entries);
    Ok(Checkpoint { rest, ..checkpoint })
}

/// Saves the state at `time`, where all participants have just continued at `cut`, so that a restart need not go back further.
/// Returns the participant that failed meanwhile, if one did.
pub(super) fn keep_for_restarts<E: Executor + ?Sized>(
    executor: &mut E,
    course: &mut Course,
    time: Rational,
    cut: Cut,
) -> Result<Option<Fallen>, RunFailure> {
    if !executor.outlives_failures() || !course.scenario.restarts() {
        return Ok(None);
    }
    match saved(executor, course, time, cut) {
        Ok(checkpoint) => {
            course.last_checkpoint = Some(checkpoint);
            Ok(None)
        }
        Err(failure) => Fallen::of(course, failure).map(Some),
    }
}

fn checkpoint(executor: &mut dyn Executor, course: &mut Course, now: Ticks, file: bool) -> Result<(), RunFailure> {
    // Where participants cannot fail individually, none is restarted.
    if !file && !executor.outlives_failures() {
        return Ok(());
    }
    let cut = course.recorder().cut_at(now);
    let checkpoint = saved(executor, course, course.time(now), cut)?;
    if let (true, Some(folder)) = (file, &course.folder) {
        // The tape first: a checkpoint is of no use without the samples before it.
        course.recorder().flush()?;
        checkpoint.write(&folder.checkpoints())?;
    }
    course.last_checkpoint = Some(checkpoint);
    Ok(())
}

/// The substitution number `number` of the scenario, at `now`.
fn substitute(
    executor: &mut dyn Executor,
    course: &mut Course,
    now: Ticks,
    number: usize,
) -> Result<Vec<Fallen>, RunFailure> {
    let substitution = &course.scenario.substitutions[number];
    let (seat, how, entry) = (substitution.participant, substitution.state, substitution.entry.clone());
    let state = match how {
        State::Cold => None,
        State::Keep => Some(executor.save(course, seat)?),
    };
    let cut = course.recorder().cut_at(now);
    let event = prepare::substitution_event(&course.plan, now, &cut, seat, &entry, how);
    let mut new = Some((entry, state));
    let seats = (0..course.entries.len())
        .map(|number| match new.take_if(|_| number == seat) {
            Some((entry, state)) => Seat::New(Box::new(entry), state),
            None => Seat::Same(None),
        })
        .collect();
    let mut fallen = executor.take_up(course, &cut, seats, false)?;
    course.substituted = number + 1;
    {
        let mut recorder = course.recorder();
        recorder.renew(seat);
        recorder.event(&event)?;
    }
    if fallen.is_empty() {
        fallen.extend(keep_for_restarts(executor, course, course.time(now), cut)?);
    }
    Ok(fallen)
}

/// Waits for the user; returns whether the run continues.
fn pause(executor: &mut dyn Executor, course: &mut Course, now: Ticks) -> Result<bool, RunFailure> {
    // Readers of the tape now see everything before the rest.
    course.recorder().flush()?;
    let steering = course.guide.hold(now);
    let (processes, options) = (executor.processes(), &course.options);
    let go_on = prepare::pause(
        &course.plan,
        now,
        &processes,
        &options.progress,
        &options.interrupt,
        steering.as_deref(),
        || executor.failure(course),
    );
    course.guide.go_on();
    go_on
}
