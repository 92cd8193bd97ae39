//! The single-threaded executor: all participants in one loop, in the order of simulated time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::sync::Arc;

use super::{LocalParticipant, RunError};
use crate::participant::{Participant, PendingStep, Sink, Termination};
use crate::plan::{Plan, Position};
use crate::stepper::{PositionError, Progress, Stepper};
use crate::time::Ticks;

/// Why a call of [`InLoop::run_to`] returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// Every activation before the horizon is done.
    Horizon,
    /// A step is to be executed together with those of other loops: [`InLoop::pending`]. Repeating the same call continues after it.
    Deferred,
    /// The participant of [`InLoop::run_to_step`] is paused before its step.
    BeforeStep,
}

/// An event in a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopEvent {
    /// A participant is about to be polled for an activation.
    Started,
    /// The participant of the last [`LoopEvent::Started`] has completed its activation.
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
    due: BinaryHeap<Reverse<DueActivation>>,
    /// Activations that wait for one of higher rank at the same instant.
    waiting: Vec<DueActivation>,
    started: bool,
    /// The participant whose step is left to the caller.
    deferred: Option<usize>,
}

/// The next activation of a stepper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct DueActivation {
    instant: Ticks,
    rank: u32,
    number: u32,
}

impl DueActivation {
    /// The next activation of `stepper`, if it has one.
    fn of(stepper: &Stepper, rank: u32, number: u32) -> Option<DueActivation> {
        (stepper.next_activation() < stepper.assignment().activations).then(|| DueActivation {
            instant: stepper.next_instant(),
            rank,
            number,
        })
    }
}

impl InLoop {
    /// A loop over parts that were assembled for `plan`.
    pub fn new(plan: &Plan, parts: Vec<LocalParticipant>) -> InLoop {
        InLoop::of(plan, parts.into_iter().map(LocalParticipant::into_stepper).collect())
    }

    /// A loop that resumes at `positions`, after earlier activations were done elsewhere.
    ///
    /// # Errors
    /// When a position does not fit its part.
    pub fn resume(
        plan: &Plan,
        parts: Vec<LocalParticipant>,
        positions: Vec<Position>,
    ) -> Result<InLoop, PositionError> {
        let steppers = parts.into_iter().zip(positions);
        let steppers = steppers.map(|(part, position)| part.into_stepper_at(position));
        Ok(InLoop::of(plan, steppers.collect::<Result<_, _>>()?))
    }

    fn of(plan: &Plan, steppers: Vec<Stepper>) -> InLoop {
        let ranked = steppers.iter().zip(&plan.participants).enumerate();
        let due = ranked.filter_map(|(number, (stepper, own))| DueActivation::of(stepper, own.rank, number as u32));
        let due: BinaryHeap<Reverse<DueActivation>> = due.map(Reverse).collect();
        InLoop {
            waiting: Vec::with_capacity(due.len()),
            due,
            steppers,
            started: false,
            deferred: None,
        }
    }

    /// Does every activation before `horizon`, in order. Calls `watch` when a participant begins to work on an activation, and when it
    /// has completed it. Reaches the horizon unless [`defer_steps`](InLoop::defer_steps) was called.
    pub fn run_to(&mut self, horizon: Ticks, watch: impl FnMut(LoopEvent)) -> Result<StopReason, RunError> {
        self.steppers.iter_mut().for_each(Stepper::release);
        self.advance_to(horizon, watch)
    }

    /// Like [`InLoop::run_to`], but only until participant number `number` has the inputs of its next activation before `horizon`, and
    /// has not been stepped: then everything before that instant is done, and at the instant whatever must come before it. A participant
    /// that is already paused there is stepped first.
    pub fn run_to_step(
        &mut self,
        number: usize,
        horizon: Ticks,
        watch: impl FnMut(LoopEvent),
    ) -> Result<StopReason, RunError> {
        for (other, stepper) in self.steppers.iter_mut().enumerate() {
            if other == number {
                stepper.pause_before_step();
            } else {
                stepper.release();
            }
        }
        self.advance_to(horizon, watch)
    }

    /// Does every activation before `horizon`, or until a participant is paused before its step or its step is left to the caller.
    fn advance_to(&mut self, horizon: Ticks, mut watch: impl FnMut(LoopEvent)) -> Result<StopReason, RunError> {
        self.deferred = None;
        if !self.started {
            // Before any horizon is set, this publishes the samples that exist before the run starts.
            self.publish_pending()?;
            self.started = true;
        }
        for stepper in &mut self.steppers {
            stepper.extend_horizon(horizon);
        }
        while let Some(&Reverse(DueActivation { instant, .. })) = self.due.peek() {
            if instant >= horizon {
                break;
            }
            let reason = self.run_instant(instant, &mut watch)?;
            if reason != StopReason::Horizon {
                return Ok(reason);
            }
        }
        self.publish_pending().map(|()| StopReason::Horizon)
    }

    /// Leaves the steps of participants that support it to the caller, to be executed together with those of other loops.
    pub fn defer_steps(&mut self) {
        self.steppers.iter_mut().for_each(Stepper::defer_steps);
    }

    /// The step that is ready to be executed, if there is one.
    pub fn pending(&mut self) -> Option<PendingStep<'_>> {
        self.steppers[self.deferred?].pending()
    }

    /// Does all activations at `now`. Ranks give the order; where a cycle of zero-delay links is open only at this instant, a
    /// participant may have to wait for one of higher rank, and is then polled again.
    fn run_instant(&mut self, now: Ticks, watch: &mut impl FnMut(LoopEvent)) -> Result<StopReason, RunError> {
        loop {
            let mut progressed = false;
            while let Some(next) = self.due.peek_mut().filter(|due| due.0.instant == now) {
                let DueActivation { rank, number, .. } = next.0;
                let stepper = &mut self.steppers[number as usize];
                let activation = stepper.next_activation();
                watch(LoopEvent::Started);
                match stepper.poll().map_err(|source| RunError::of(stepper, source))? {
                    Progress::Stepped => {
                        progressed = true;
                        replace_due(next, DueActivation::of(stepper, rank, number));
                        watch(LoopEvent::Stepped {
                            participant: number as usize,
                            activation,
                        });
                    }
                    Progress::BeforeStep => return Ok(StopReason::BeforeStep),
                    Progress::Deferred => {
                        self.deferred = Some(number as usize);
                        return Ok(StopReason::Deferred);
                    }
                    Progress::Waiting(_) | Progress::AtHorizon | Progress::Finished => {
                        self.waiting.push(PeekMut::pop(next).0);
                    }
                }
            }
            if self.waiting.is_empty() {
                return Ok(StopReason::Horizon);
            }
            self.due.extend(self.waiting.drain(..).map(Reverse));
            if !progressed {
                return Err(self.deadlock_error(now));
            }
        }
    }

    /// Records and sends the pending samples of every participant.
    fn publish_pending(&mut self) -> Result<(), RunError> {
        for stepper in &mut self.steppers {
            match stepper.poll().map_err(|source| RunError::of(stepper, source))? {
                Progress::AtHorizon | Progress::Finished => {}
                Progress::Stepped | Progress::Waiting(_) | Progress::BeforeStep | Progress::Deferred => {
                    let now = stepper.next_instant();
                    return Err(self.deadlock_error(now));
                }
            }
        }
        Ok(())
    }

    fn deadlock_error(&mut self, now: Ticks) -> RunError {
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
        RunError::Deadlock {
            t,
            waiting: waiting.join("; "),
        }
    }

    /// Notifies participant number `number` that another one replaces it, before that one begins.
    pub fn notify_replaced(&mut self, number: usize) {
        self.steppers[number].terminate(Termination::Replaced);
    }

    /// Replaces participant number `number` by `participant`, with all participants paused: the others keep their state. The new one
    /// must already be prepared: see [`crate::stepper::prepare_to_resume`].
    pub fn replace(&mut self, number: usize, participant: Box<dyn Participant>) {
        self.steppers[number].replace(participant);
        // Between processes a replacement moves all participants, and only what was published moves along.
        self.steppers.iter_mut().for_each(Stepper::clear_unpublished_outputs);
    }

    /// Sets the value of an input without a link from the next activation of participant number `number` on.
    ///
    /// # Panics
    /// When the input has a link or the size of `payload` is wrong: a mistake of the caller.
    pub fn set_input(&mut self, number: usize, input: usize, payload: &[u8]) {
        self.steppers[number].set_input(input, payload);
        self.steppers.iter_mut().for_each(Stepper::clear_unpublished_outputs);
    }

    /// Provides output number `output` of the activation before whose step participant number `number` is paused: see [`Stepper::set_output`].
    ///
    /// # Panics
    /// As for [`Stepper::set_output`].
    pub fn set_output(&mut self, number: usize, output: usize, payload: &[u8]) {
        self.steppers[number].set_output(output, payload);
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
fn replace_due(mut done: PeekMut<'_, Reverse<DueActivation>>, next: Option<DueActivation>) {
    match next {
        Some(next) => done.0 = next,
        None => {
            PeekMut::pop(done);
        }
    }
}
