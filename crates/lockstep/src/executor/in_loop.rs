//! All participants in one loop, in the order of simulated time.

use super::{Part, RunError};
use crate::participant::Participant;
use crate::plan::{Plan, Position};
use crate::stepper::{PositionError, Progress, Stepper};
use crate::time::Ticks;

/// What happens in a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Somebody begins to work on an activation.
    Begins,
    /// Who began last has completed its activation.
    Stepped {
        /// Its number.
        participant: usize,
        /// The activation.
        activation: u64,
    },
}

/// A run in one loop of one thread: the fastest way without parallelism, and the measure for the other executors.
pub struct InLoop {
    steppers: Vec<Stepper>,
    /// Positions of the steppers, ordered by rank.
    by_rank: Vec<usize>,
    started: bool,
}

impl InLoop {
    /// A loop over parts that were assembled for `plan`.
    pub fn new(plan: &Plan, parts: Vec<Part>) -> InLoop {
        InLoop::of(plan, parts.into_iter().map(Part::stepper).collect())
    }

    /// A loop that goes on where others have done the work before.
    ///
    /// # Errors
    /// When a position does not belong to its part.
    pub fn resume(plan: &Plan, parts: Vec<Part>, positions: Vec<Position>) -> Result<InLoop, PositionError> {
        let steppers = parts.into_iter().zip(positions);
        let steppers = steppers.map(|(part, position)| part.stepper_at(position));
        Ok(InLoop::of(plan, steppers.collect::<Result<_, _>>()?))
    }

    fn of(plan: &Plan, steppers: Vec<Stepper>) -> InLoop {
        let mut by_rank: Vec<usize> = (0..steppers.len()).collect();
        by_rank.sort_by_key(|&number| plan.participants[number].rank);
        InLoop {
            steppers,
            by_rank,
            started: false,
        }
    }

    /// Does every activation before `horizon`, in order. Tells `watch` when a participant begins to work on an activation, and when it
    /// has completed it.
    pub fn run_to(&mut self, horizon: Ticks, mut watch: impl FnMut(Moment)) -> Result<(), RunError> {
        if !self.started {
            // Before any horizon is given, this publishes what exists before the run starts.
            self.settle()?;
            self.started = true;
        }
        for stepper in &mut self.steppers {
            stepper.extend_horizon(horizon);
        }
        loop {
            let next = self
                .steppers
                .iter()
                .filter(|s| s.next_activation() < s.assignment().activations);
            let now = next.map(Stepper::next_instant).min().unwrap_or(Ticks::MAX);
            if now >= horizon {
                return self.settle();
            }
            self.instant(now, &mut watch)?;
        }
    }

    /// All activations at `now`. Ranks give the order; where a circle of zero-delay links is open only at this instant,
    /// a participant may have to wait for one of higher rank, and its turn comes again.
    fn instant(&mut self, now: Ticks, watch: &mut impl FnMut(Moment)) -> Result<(), RunError> {
        loop {
            let (mut moved, mut left) = (false, false);
            for &number in &self.by_rank {
                let stepper = &mut self.steppers[number];
                if stepper.next_instant() != now || stepper.next_activation() >= stepper.assignment().activations {
                    continue;
                }
                let activation = stepper.next_activation();
                watch(Moment::Begins);
                match stepper.poll().map_err(|source| RunError::of(stepper, source))? {
                    Progress::Stepped => {
                        moved = true;
                        watch(Moment::Stepped {
                            participant: number,
                            activation,
                        });
                    }
                    Progress::Waiting(_) => left = true,
                    Progress::AtHorizon | Progress::Finished => {}
                }
            }
            if !left {
                return Ok(());
            }
            if !moved {
                return Err(self.stuck(now));
            }
        }
    }

    /// Hands over what is still on its way to the tape.
    fn settle(&mut self) -> Result<(), RunError> {
        for stepper in &mut self.steppers {
            match stepper.poll().map_err(|source| RunError::of(stepper, source))? {
                Progress::AtHorizon | Progress::Finished => {}
                Progress::Stepped | Progress::Waiting(_) => {
                    let now = stepper.next_instant();
                    return Err(self.stuck(now));
                }
            }
        }
        Ok(())
    }

    fn stuck(&mut self, now: Ticks) -> RunError {
        let t = self
            .steppers
            .first()
            .map_or(0.0, |s| s.assignment().timebase.seconds(now));
        let waiting: Vec<String> = self
            .steppers
            .iter_mut()
            .filter_map(|stepper| {
                let progress = stepper.poll().ok()?;
                Some(format!(
                    "`{}` at activation {}: {progress:?}",
                    stepper.assignment().name,
                    stepper.next_activation()
                ))
            })
            .collect();
        RunError::Stuck {
            t,
            waiting: waiting.join("; "),
        }
    }

    /// Puts `participant` in the place of number `number`, where everybody rests: the others keep what they have. It is as it
    /// should be there: see [`crate::stepper::settle`].
    pub fn replace(&mut self, number: usize, participant: Box<dyn Participant>) {
        self.steppers[number].replace(participant);
        // Between processes everybody moves when somebody is replaced, and only what was published moves along.
        self.steppers.iter_mut().for_each(Stepper::forget_unpublished);
    }

    /// Sets what an input without a link shows from the next activation of participant number `number` on.
    ///
    /// # Panics
    /// When the input has a link or `payload` has another size: a mistake of the caller.
    pub fn set_input(&mut self, number: usize, input: usize, payload: &[u8]) {
        self.steppers[number].set_input(input, payload);
        self.steppers.iter_mut().for_each(Stepper::forget_unpublished);
    }

    /// The participants, without their links.
    pub fn into_participants(self) -> Vec<Box<dyn Participant>> {
        self.steppers.into_iter().map(Stepper::into_participant).collect()
    }

    /// The participants, for figures that only they know.
    pub fn steppers(&self) -> &[Stepper] {
        &self.steppers
    }
}
