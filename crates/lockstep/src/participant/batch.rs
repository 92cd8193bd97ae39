//! Batch stepping: participants of one type, from runs that advance side by side, stepped by one call.

use std::any::{Any, TypeId};

use super::buffers::{Inputs, Outputs};
use super::step::{Failure, Step};

/// A participant of which several instances can be stepped by one call, where that is cheaper than stepping one after the other: a
/// campaign runs points side by side, and their models differ only in their numbers.
///
/// Each participant must end with the state and the outputs that [`Participant::step`](super::Participant::step) alone would give, to the
/// last bit. Which participants are stepped together is unspecified.
///
/// ```
/// use lockstep::participant::{BatchedStep, Failure, Inputs, Interface, Kind, Member, Outputs, Participant, Step, StepBatch};
///
/// struct Decay {
///     x: f64,
/// }
///
/// impl Participant for Decay {
///     fn interface(&self) -> Interface {
///         Interface::new(Kind::Continuous)
///     }
///     fn step(&mut self, step: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
///         self.x -= step.period * self.x;
///         Ok(())
///     }
///     fn batch_member(&mut self) -> Option<Member<'_>> {
///         Some(Member::of(self))
///     }
/// }
///
/// impl StepBatch for Decay {
///     type Common = ();
///     fn step_batch(steps: &mut [BatchedStep<'_, Decay>], (): &mut ()) {
///         for four in steps.chunks_mut(4) {
///             // the same operations in the same order; a compiler makes one instruction of four
///             let mut x = [0.0; 4];
///             for (x, one) in x.iter_mut().zip(&*four) {
///                 *x = one.participant.x - one.step.period * one.participant.x;
///             }
///             for (x, one) in x.iter().zip(four) {
///                 one.participant.x = *x;
///             }
///         }
///     }
/// }
///
/// let mut decay = Decay { x: 1.0 };
/// assert!(decay.batch_member().is_some());
/// ```
pub trait StepBatch: Sized + 'static {
    /// Working data kept from one call to the next to save work. No result may depend on it: any call may receive a new one.
    type Common: Default + 'static;

    /// The number of participants that are stepped most efficiently by one call on this machine, for example the number of SIMD lanes.
    fn efficient_size() -> usize {
        4
    }

    /// Steps the participants of `steps`, one or more. They need not be at the same instant, nor have the same period or parameters.
    fn step_batch(steps: &mut [BatchedStep<'_, Self>], common: &mut Self::Common);
}

/// A participant in a batch, with the arguments of [`Participant::step`](super::Participant::step).
pub struct BatchedStep<'a, P> {
    /// The participant.
    pub participant: &'a mut P,
    /// The activation.
    pub step: Step,
    /// Its inputs.
    pub inputs: &'a Inputs,
    /// Its outputs.
    pub outputs: &'a mut Outputs,
    result: &'a mut Option<Result<(), Failure>>,
}

impl<P> BatchedStep<'_, P> {
    /// Reports that the step of this participant failed; the others continue.
    pub fn fail(&mut self, failure: Failure) {
        *self.result = Some(Err(failure));
    }
}

/// A participant that can be stepped together with others of its type.
pub struct Member<'a> {
    kind: BatchType,
    participant: &'a mut dyn Any,
}

impl<'a> Member<'a> {
    /// `participant`, stepped with others of its type.
    pub fn of<P: StepBatch>(participant: &'a mut P) -> Member<'a> {
        let kind = BatchType {
            kind: TypeId::of::<P>(),
            efficient_size: P::efficient_size,
            common: || Box::new(P::Common::default()),
            step: step::<P>,
        };
        Member { kind, participant }
    }

    /// The number of participants of this type that are stepped most efficiently by one call.
    pub fn efficient_size(&self) -> usize {
        (self.kind.efficient_size)()
    }
}

/// How the participants of one type are stepped together.
#[derive(Clone, Copy)]
struct BatchType {
    kind: TypeId,
    efficient_size: fn() -> usize,
    common: fn() -> Box<dyn Any>,
    step: fn(&mut [&mut PendingStep<'_>], &mut dyn Any),
}

/// A step that is ready to be executed: all of its inputs have been received.
pub struct PendingStep<'a> {
    pub(crate) member: Member<'a>,
    pub(crate) step: Step,
    pub(crate) inputs: &'a Inputs,
    pub(crate) outputs: &'a mut Outputs,
    pub(crate) result: &'a mut Option<Result<(), Failure>>,
}

fn step<P: StepBatch>(pending: &mut [&mut PendingStep<'_>], common: &mut dyn Any) {
    let mut steps: Vec<BatchedStep<'_, P>> = pending
        .iter_mut()
        .filter_map(|one| {
            *one.result = Some(Ok(()));
            Some(BatchedStep {
                participant: one.member.participant.downcast_mut()?,
                step: one.step,
                inputs: one.inputs,
                outputs: one.outputs,
                result: one.result,
            })
        })
        .collect();
    let mut fresh = P::Common::default();
    P::step_batch(&mut steps, common.downcast_mut().unwrap_or(&mut fresh));
}

/// Executes steps of different runs together, type by type, and keeps the working data of each type.
#[derive(Default)]
pub struct BatchStepper {
    common_data: Vec<(TypeId, Box<dyn Any>)>,
}

impl BatchStepper {
    /// Executes the steps of `pending`, which belong to different participants. A panic leaves all of them half done.
    pub fn step(&mut self, pending: &mut [PendingStep<'_>]) {
        let mut remaining: Vec<&mut PendingStep<'_>> = pending.iter_mut().collect();
        while let Some(first) = remaining.first() {
            let BatchType { kind, common, step, .. } = first.member.kind;
            let (mut batch, others) = remaining.into_iter().partition(|one| one.member.kind.kind == kind);
            remaining = others;
            let at = match self.common_data.iter().position(|(known, _)| *known == kind) {
                Some(at) => at,
                None => {
                    self.common_data.push((kind, common()));
                    self.common_data.len() - 1
                }
            };
            let batch: &mut Vec<_> = &mut batch;
            step(batch, &mut *self.common_data[at].1);
        }
    }
}
