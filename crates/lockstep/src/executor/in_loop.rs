//! All participants in one loop, in the order of simulated time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::sync::Arc;

use super::{Part, RunError};
use crate::participant::{Participant, Pending, Sink, Termination};
use crate::plan::{Plan, Position};
use crate::stepper::{PositionError, Progress, Stepper};
use crate::time::Ticks;

/// How far a call of [`InLoop::run_to`] came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Every activation before the horizon is done.
    Horizon,
    /// A step is to be done beside those of other loops: [`InLoop::pending`]. The same call again goes on behind it.
    Parked,
    /// The participant of [`InLoop::run_before`] is held before its step.
    Held,
}

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
    /// The next activation of each stepper that has one, the earliest first: an instant costs what its own activations cost, however many
    /// participants have none there.
    due: BinaryHeap<Reverse<Due>>,
    /// Those that wait for one of higher rank at the same instant.
    waiting: Vec<Due>,
    started: bool,
    /// Whose step is to be done by others.
    parked: Option<usize>,
}

/// The next activation of a stepper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Due {
    instant: Ticks,
    rank: u32,
    number: u32,
}

impl Due {
    /// The next activation of `stepper`, if it has one.
    fn of(stepper: &Stepper, rank: u32, number: u32) -> Option<Due> {
        (stepper.next_activation() < stepper.assignment().activations).then(|| Due {
            instant: stepper.next_instant(),
            rank,
            number,
        })
    }
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
        let ranked = steppers.iter().zip(&plan.participants).enumerate();
        let due = ranked.filter_map(|(number, (stepper, own))| Due::of(stepper, own.rank, number as u32));
        let due: BinaryHeap<Reverse<Due>> = due.map(Reverse).collect();
        InLoop {
            waiting: Vec::with_capacity(due.len()),
            due,
            steppers,
            started: false,
            parked: None,
        }
    }

    /// Does every activation before `horizon`, in order. Tells `watch` when a participant begins to work on an activation, and when it
    /// has completed it. Unless the loop was told to [park](InLoop::park), it reaches the horizon.
    pub fn run_to(&mut self, horizon: Ticks, watch: impl FnMut(Moment)) -> Result<Reach, RunError> {
        self.steppers.iter_mut().for_each(Stepper::let_go);
        self.go(horizon, watch)
    }

    /// As [`InLoop::run_to`], but only until participant number `number` has the inputs of its next activation before `horizon`, and has not
    /// stepped: then everything before that instant is done, and at the instant what must come before. One that is held already
    /// steps first.
    pub fn run_before(&mut self, number: usize, horizon: Ticks, watch: impl FnMut(Moment)) -> Result<Reach, RunError> {
        for (other, stepper) in self.steppers.iter_mut().enumerate() {
            if other == number {
                stepper.hold();
            } else {
                stepper.let_go();
            }
        }
        self.go(horizon, watch)
    }

    /// Does every activation before `horizon`, or until a participant is held or its step is left to others.
    fn go(&mut self, horizon: Ticks, mut watch: impl FnMut(Moment)) -> Result<Reach, RunError> {
        self.parked = None;
        if !self.started {
            // Before any horizon is given, this publishes what exists before the run starts.
            self.settle()?;
            self.started = true;
        }
        for stepper in &mut self.steppers {
            stepper.extend_horizon(horizon);
        }
        while let Some(&Reverse(Due { instant, .. })) = self.due.peek() {
            if instant >= horizon {
                break;
            }
            let reach = self.instant(instant, &mut watch)?;
            if reach != Reach::Horizon {
                return Ok(reach);
            }
        }
        self.settle().map(|()| Reach::Horizon)
    }

    /// Leaves the steps of participants that allow it to others, who do them beside those of other loops.
    pub fn park(&mut self) {
        self.steppers.iter_mut().for_each(Stepper::park);
    }

    /// The step that waits to be done, if one does.
    pub fn pending(&mut self) -> Option<Pending<'_>> {
        self.steppers[self.parked?].pending()
    }

    /// All activations at `now`. Ranks give the order; where a circle of zero-delay links is open only at this instant,
    /// a participant may have to wait for one of higher rank, and its turn comes again.
    fn instant(&mut self, now: Ticks, watch: &mut impl FnMut(Moment)) -> Result<Reach, RunError> {
        loop {
            let mut moved = false;
            while let Some(next) = self.due.peek_mut().filter(|due| due.0.instant == now) {
                let Due { rank, number, .. } = next.0;
                let stepper = &mut self.steppers[number as usize];
                let activation = stepper.next_activation();
                watch(Moment::Begins);
                match stepper.poll().map_err(|source| RunError::of(stepper, source))? {
                    Progress::Stepped => {
                        moved = true;
                        replace(next, Due::of(stepper, rank, number));
                        watch(Moment::Stepped {
                            participant: number as usize,
                            activation,
                        });
                    }
                    Progress::Held => return Ok(Reach::Held),
                    Progress::Parked => {
                        self.parked = Some(number as usize);
                        return Ok(Reach::Parked);
                    }
                    Progress::Waiting(_) | Progress::AtHorizon | Progress::Finished => {
                        self.waiting.push(PeekMut::pop(next).0);
                    }
                }
            }
            if self.waiting.is_empty() {
                return Ok(Reach::Horizon);
            }
            self.due.extend(self.waiting.drain(..).map(Reverse));
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
                Progress::Stepped | Progress::Waiting(_) | Progress::Held | Progress::Parked => {
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

    /// Tells participant number `number` that another one takes its place: before that one begins.
    pub fn retire(&mut self, number: usize) {
        self.steppers[number].terminate(Termination::Replaced);
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

    /// Gives output number `output` of the activation before which participant number `number` is held: see [`Stepper::answer`].
    ///
    /// # Panics
    /// As there.
    pub fn answer(&mut self, number: usize, output: usize, payload: &[u8]) {
        self.steppers[number].answer(output, payload);
    }

    /// Where the participants' lines go; without it to standard error.
    pub fn log_to(&mut self, sink: &Arc<dyn Sink>) {
        self.steppers.iter_mut().for_each(|stepper| stepper.log_to(sink));
    }

    /// The participants, without their links. They have not been told that their part is over.
    pub fn into_participants(self) -> Vec<Box<dyn Participant>> {
        self.steppers.into_iter().map(Stepper::into_participant).collect()
    }

    /// The participants, for figures that only they know.
    pub fn steppers(&self) -> &[Stepper] {
        &self.steppers
    }
}

/// Puts the activation that comes after `done` in its place.
fn replace(mut done: PeekMut<'_, Reverse<Due>>, next: Option<Due>) {
    match next {
        Some(next) => done.0 = next,
        None => {
            PeekMut::pop(done);
        }
    }
}
