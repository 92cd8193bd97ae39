//! The stop schedule: where a run pauses before its end, and for what.

use std::collections::VecDeque;

use lockstep::plan::Plan;
use lockstep::time::{Rational, Ticks};

use crate::run::options::Options;
use crate::run::outcome::RunFailure;
use crate::scenario::Scenario;

/// The action at a stop. At one instant actions take place in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Action {
    /// The state of the run is saved, in memory for a restart or in a file.
    Checkpoint { file: bool },
    /// This substitution of the scenario takes place.
    Substitute(usize),
    /// The run waits for the user.
    Pause,
}

/// The most checkpoints of a run.
pub(crate) const CHECKPOINTS_MAX: usize = 10_000;

/// The stops to come, in order.
#[derive(Debug, Default)]
pub(crate) struct Schedule(VecDeque<(Ticks, Action)>);

impl Schedule {
    /// All stops that `scenario` and `options` ask for from `from` on. `substituted` substitutions have taken place.
    pub(crate) fn new(
        scenario: &Scenario,
        plan: &Plan,
        options: &Options,
        from: Ticks,
        substituted: usize,
    ) -> Result<Schedule, RunFailure> {
        let instant = |time: Rational| {
            let ticks = plan.timebase.ceil(time);
            ticks.map_err(|error| RunFailure::Other(error.to_string()))
        };
        let mut stops: Vec<(Ticks, Action)> = Vec::new();
        for &time in &options.pause_at {
            stops.push((instant(time)?, Action::Pause));
        }
        let mut checkpoints = Vec::new();
        for &time in &options.checkpoint_at {
            checkpoints.push((instant(time)?, Action::Checkpoint { file: true }));
        }
        if let Some(every) = options.checkpoint_every {
            let mut time = every;
            while time < scenario.duration {
                checkpoints.push((instant(time)?, Action::Checkpoint { file: true }));
                time = time
                    .checked_add(every)
                    .ok_or_else(|| RunFailure::Other(format!("{every} is too fine for a checkpoint")))?;
            }
        }
        stops.append(&mut checkpoints);
        for (number, substitution) in scenario.substitutions.iter().enumerate().skip(substituted) {
            let at = instant(substitution.at)?;
            stops.push((at, Action::Substitute(number)));
        }
        // What was done before the checkpoint was saved that this run continues from is not done again.
        stops.retain(|&(at, action)| {
            let early = match action {
                Action::Checkpoint { .. } => from > 0 && at <= from,
                Action::Substitute(_) | Action::Pause => at < from,
            };
            !early && at < plan.end
        });
        if scenario.restarts() {
            stops.push((from, Action::Checkpoint { file: false }));
        }
        stops.sort_unstable();
        stops.dedup();
        Ok(Schedule(stops.into()))
    }

    /// The run goes back: the substitutions of `scenario` from number `substituted` on are still to come.
    pub(crate) fn rewind(&mut self, scenario: &Scenario, plan: &Plan, substituted: usize) {
        self.0.retain(|(_, action)| !matches!(action, Action::Substitute(_)));
        for (number, substitution) in scenario.substitutions.iter().enumerate().skip(substituted) {
            match plan.timebase.ceil(substitution.at) {
                Ok(at) if at < plan.end => self.0.push_back((at, Action::Substitute(number))),
                _ => {}
            }
        }
        self.0.make_contiguous().sort_unstable();
    }

    /// Only pauses.
    #[cfg(test)]
    pub(crate) fn of_pauses(stops: Vec<Ticks>) -> Schedule {
        Schedule(stops.into_iter().map(|at| (at, Action::Pause)).collect())
    }

    /// The next stop.
    pub(crate) fn next(&self) -> Option<Ticks> {
        self.0.front().map(|&(at, _)| at)
    }

    /// Takes the next action at `now`.
    pub(crate) fn take(&mut self, now: Ticks) -> Option<Action> {
        let (_, action) = self.0.pop_front_if(|(at, _)| *at == now)?;
        Some(action)
    }

    /// Puts back an action that was taken.
    pub(crate) fn put_back(&mut self, now: Ticks, action: Action) {
        self.0.push_front((now, action));
    }
}
