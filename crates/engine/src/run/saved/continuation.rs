//! Whether a scenario can continue from where a run was saved: it must have the same participants and sample times, and end later.
//!
//! That follows from the scenario alone, so it is checked before anything is started or written.

use lockstep::time::{Rational, SampleTime, TickError, Timebase};

use super::checkpoint::Checkpoint;
use crate::run::outcome::RunFailure;
use crate::scenario::{Scenario, ScenarioError};

/// The position of a scenario at an instant.
struct ScenarioPosition {
    /// How many activations each participant has done before it.
    done: Vec<u64>,
    /// How many substitutions have taken place before it. One at the instant itself comes after it.
    substituted: u64,
    /// Whether the instant is before the end.
    before_end: bool,
}

impl ScenarioPosition {
    fn of(scenario: &Scenario, time: Rational) -> Result<ScenarioPosition, TickError> {
        let entries = &scenario.participants;
        let timebase = timebase(scenario)?;
        let (at, end) = (timebase.ceil(time)?, timebase.ceil(scenario.duration)?);
        let done = entries.iter().map(|entry| {
            let sample_time = SampleTime {
                offset: timebase.ceil(entry.offset)?,
                period: timebase.ceil(entry.period)?,
            };
            Ok(sample_time.count_before(at.min(end)))
        });
        let substitutions = scenario.substitutions.iter().map(|one| timebase.ceil(one.at));
        Ok(ScenarioPosition {
            done: done.collect::<Result<_, _>>()?,
            substituted: substitutions
                .filter(|one| one.as_ref().is_ok_and(|one| *one < at))
                .count() as u64,
            before_end: at < end,
        })
    }
}

/// The timebase of a run of `scenario`.
pub(super) fn timebase(scenario: &Scenario) -> Result<Timebase, TickError> {
    let entries = scenario.participants.iter();
    Timebase::from_times(entries.flat_map(|entry| [entry.period, entry.offset]))
}

fn position(scenario: &Scenario, time: Rational) -> Result<ScenarioPosition, RunFailure> {
    ScenarioPosition::of(scenario, time).map_err(|error| RunFailure::Other(error.to_string()))
}

/// Checks that `scenario` can continue from `checkpoint`.
///
/// # Errors
/// The keys that prevent it.
pub(crate) fn check(scenario: &Scenario, checkpoint: &Checkpoint) -> Result<(), RunFailure> {
    let names = || scenario.participants.iter().map(|entry| entry.setup.name.as_str());
    if !names().eq(checkpoint.participants.iter().map(String::as_str)) {
        let reason = format!(
            "the run that was saved has {}, the scenario has {}: a resumed run has the same participants",
            checkpoint.participants.join(", "),
            names().collect::<Vec<_>>().join(", ")
        );
        return Err(scenario.key_refusal("participants", &reason).into());
    }
    let (time, position) = (checkpoint.time, position(scenario, checkpoint.time)?);
    if !position.before_end {
        let reason = format!(
            "the run ends at {}, and would be taken up at t = {time}: make it longer with --duration, or name an earlier checkpoint with \
             --from",
            scenario.duration
        );
        return Err(scenario.key_refusal("duration", &reason).into());
    }
    check_same_sample_times(scenario, time, &position.done, &checkpoint.cut.next)?;
    if position.substituted != checkpoint.substitutions {
        let reason = format!(
            "{} substitutions had happened at t = {time}, and here {} are before then: leave in the scenario what has happened",
            checkpoint.substitutions, position.substituted
        );
        return Err(scenario.key_refusal("faults", &reason).into());
    }
    Ok(())
}

/// Checks that `scenario` can continue from where `unchanged`, the scenario of the run, is `at`.
///
/// # Errors
/// The keys that prevent it. An instant after the end is reported by [`crate::run::branch`].
pub fn check_branch(scenario: &Scenario, unchanged: &Scenario, at: Rational) -> Result<(), RunFailure> {
    let (changed, before) = (position(scenario, at)?, position(unchanged, at)?);
    if !changed.before_end || changed.done.len() != before.done.len() {
        return Ok(());
    }
    Ok(check_same_sample_times(scenario, at, &changed.done, &before.done)?)
}

/// Refuses participants that have done a different number of activations than in the run.
fn check_same_sample_times(
    scenario: &Scenario,
    time: Rational,
    done: &[u64],
    done_in_run: &[u64],
) -> Result<(), ScenarioError> {
    let differ = (done.iter().zip(done_in_run).enumerate()).filter(|(_, (done, done_in_run))| done != done_in_run);
    let wrong: Vec<(usize, String)> = differ
        .map(|(number, (done, done_in_run))| {
            let entry = &scenario.participants[number];
            let reason = format!(
                "with a period of {} and an offset of {}, `{}` has done {done} activations before t = {time}, and {done_in_run} in the run \
                 that was saved: a resumed run keeps its sample times, so leave them unchanged",
                entry.period, entry.offset, entry.setup.name
            );
            (number, reason)
        })
        .collect();
    match wrong.is_empty() {
        true => Ok(()),
        false => Err(scenario.sample_time_refusal(&wrong)),
    }
}
