//! Changes at rest: a position that is taken up, another participant in the place, values of inputs without a link.

use super::progress::Phase;
use super::{Ends, PositionError, Stepper};
use crate::participant::{Kind, Outputs, Participant, Termination};
use crate::plan::{Assignment, Position};

impl Stepper {
    /// A stepper at rest at `position`, where others have done the work before. The participant is as it should be there:
    /// initialised, with the state that `position` asks for.
    ///
    /// # Errors
    /// When the position is not one of this participant.
    pub fn resume(
        participant: Box<dyn Participant>,
        assignment: Assignment,
        ends: Ends,
        position: Position,
    ) -> Result<Stepper, PositionError> {
        position.check(&assignment)?;
        let outputs = position.outputs.clone();
        let values = position.values.clone();
        let mut stepper = Stepper::at(participant, assignment, ends, position);
        for (buffer, value) in stepper.input_buffers.payloads.iter_mut().zip(values) {
            if !value.is_empty() {
                buffer.bytes_mut().copy_from_slice(&value);
            }
        }
        for (buffer, bytes) in stepper.output_buffers.payloads.iter_mut().zip(&outputs) {
            if !bytes.is_empty() {
                buffer.bytes_mut().copy_from_slice(bytes);
            }
        }
        stepper.initialised = true;
        stepper.orders.begun = true;
        stepper.phase = Phase::Rest;
        Ok(stepper)
    }

    /// Puts `participant` in the place of the one inside, between two activations: links, schedules and what the ports hold stay
    /// as they are. The new one is as it should be there: see [`settle`](super::settle). The old one is told.
    pub(crate) fn replace(&mut self, participant: Box<dyn Participant>) {
        self.terminate(Termination::Replaced);
        self.participant = participant;
        self.orders.begun = true;
    }

    /// Makes the outputs what a stepper that has just taken up its work here holds: nothing of what was not published.
    pub(crate) fn forget_unpublished(&mut self) {
        if self.next == 0 && self.assignment.interface.kind == Kind::Sampled {
            self.output_buffers.payloads = Outputs::zeroed(&self.assignment.interface).payloads;
        }
    }

    /// Sets what input number `input`, which has no link, shows from the next activation on.
    ///
    /// # Panics
    /// When the input is fed or `payload` has another size: a mistake of the caller.
    pub(crate) fn set_input(&mut self, input: usize, payload: &[u8]) {
        let fed = self.inputs.iter().any(|link| link.port == input);
        assert!(!fed, "input {input} is fed");
        self.input_buffers.payloads[input].bytes_mut().copy_from_slice(payload);
    }
}
