//! The single-threaded executor: all participants in one loop, in the order of simulated time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::sync::Arc;

use super::{Part, RunError};
use crate::participant::{Participant, Pending, Sink, Termination};
use crate::plan::{Plan, Position};
use crate::stepper::{PositionError, Progress, Stepper};
use crate::time::Ticks;

/// The progress made by a call of [`InLoop::run_to`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Every activation before the horizon is done.
    Horizon,
    /// A step is to be executed together with those of other loops: [`InLoop::pending`]. Repeating the same call continues after it.
    Parked,
    /// The participant of [`InLoop::run_before`] is held before its step.
    Held,
}

/// An event in a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// A participant begins to work on an activation.
    Begins,
    /// The participant that began last has completed its activation.
    Stepped {
        /// The participant's number.
        participant: usize,
        /// The activation.
        activation: u64,
    },
}

/// A run in one loop of one thread: the fastest executor without parallelism, and the reference for the other executors.
pub struct InLoop {
    steppers: Vec<Stepper>,
    /// The next activation of each stepper that has one, the earliest first: the cost of an instant depends on its own activations, not
    /// on the number of participants without one.
    due: BinaryHeap<Reverse<Due>>,
    /// Activations that wait for one of higher rank at the same instant.
    waiting: Vec<Due>,
    started: bool,
    /// The participant whose step is left to the caller.
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

    /// A loop that resumes at `positions`, after earlier activations were done elsewhere.
    ///
    /// # Errors
    /// When a position does not fit its part.
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

    /// Does every activation before `horizon`, in order. Calls `watch` when a participant begins to work on an activation, and when it
    /// has completed it. Reaches the horizon unless [`park`](InLoop::park) was called.
    pub fn run_to(&mut self, horizon: Ticks, watch: impl FnMut(Moment)) -> Result<Reach, RunError> {
        self.steppers.iter_mut().for_each(Stepper::let_go);
        self.go(horizon, watch)
    }

    /// Like [`InLoop::run_to`], but only until participant number `number` has the inputs of its next activation before `horizon`, and
    /// has not been stepped: then everything before that instant is done, and at the instant whatever must come before it. A participant
    /// that is held already is stepped first.
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

    /// Does every activation before `horizon`, or until a participant is held or its step is left to the caller.
    fn go(&mut self, horizon: Ticks, mut watch: impl FnMut(Moment)) -> Result<Reach, RunError> {
        self.parked = None;
        if !self.started {
            // Before any horizon is set, this publishes the samples that exist before the run starts.
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

    /// Leaves the steps of participants that support it to the caller, to be executed together with those of other loops.
    pub fn park(&mut self) {
        self.steppers.iter_mut().for_each(Stepper::park);
    }

    /// The step that is ready to be executed, if there is one.
    pub fn pending(&mut self) -> Option<Pending<'_>> {
        self.steppers[self.parked?].pending()
    }

    /// Does all activations at `now`. Ranks give the order; where a circle of zero-delay links is open only at this instant, a
    /// participant may have to wait for one of higher rank, and is then polled again.
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

    /// Sends what has not reached the tape yet.
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

    /// Notifies participant number `number` that another one replaces it, before that one begins.
    pub fn retire(&mut self, number: usize) {
        self.steppers[number].terminate(Termination::Replaced);
    }

    /// Replaces participant number `number` by `participant`, with all participants at rest: the others keep their state. The new one
    /// must already be prepared: see [`crate::stepper::settle`].
    pub fn replace(&mut self, number: usize, participant: Box<dyn Participant>) {
        self.steppers[number].replace(participant);
        // Between processes a replacement moves all participants, and only what was published moves along.
        self.steppers.iter_mut().for_each(Stepper::forget_unpublished);
    }

    /// Sets the value of an input without a link from the next activation of participant number `number` on.
    ///
    /// # Panics
    /// When the input has a link or the size of `payload` is wrong: a mistake of the caller.
    pub fn set_input(&mut self, number: usize, input: usize, payload: &[u8]) {
        self.steppers[number].set_input(input, payload);
        self.steppers.iter_mut().for_each(Stepper::forget_unpublished);
    }

    /// Provides output number `output` of the activation before which participant number `number` is held: see [`Stepper::answer`].
    ///
    /// # Panics
    /// As for [`Stepper::answer`].
    pub fn answer(&mut self, number: usize, output: usize, payload: &[u8]) {
        self.steppers[number].answer(output, payload);
    }

    /// Sets the destination of the participants' log lines; without a call they go to standard error.
    pub fn log_to(&mut self, sink: &Arc<dyn Sink>) {
        self.steppers.iter_mut().for_each(|stepper| stepper.log_to(sink));
    }

    /// Returns the participants without their links. They have not been notified that their part is over.
    pub fn into_participants(self) -> Vec<Box<dyn Participant>> {
        self.steppers.into_iter().map(Stepper::into_participant).collect()
    }

    /// The steppers, for figures that only they have.
    pub fn steppers(&self) -> &[Stepper] {
        &self.steppers
    }
}

/// Replaces `done` in the queue by the activation that comes after it.
fn replace(mut done: PeekMut<'_, Reverse<Due>>, next: Option<Due>) {
    match next {
        Some(next) => done.0 = next,
        None => {
            PeekMut::pop(done);
        }
    }
}
