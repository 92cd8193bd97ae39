//! Changes at rest: resuming at a position, replacing the participant, setting inputs without a link.

use super::progress::Phase;
use super::{Ends, PositionError, Stepper};
use crate::participant::{Kind, Outputs, Participant, Termination};
use crate::plan::{Assignment, Position};

impl Stepper {
    /// A stepper at rest at `position`, after earlier activations were done elsewhere. The participant must already be initialised and
    /// have the state that `position` requires.
    ///
    /// # Errors
    /// When the position does not fit this participant.
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
        stepper.phase = Phase::Idle;
        Ok(stepper)
    }

    /// Replaces the participant by `participant`, between two activations: links, schedules and the values of the ports stay as they are.
    /// The new one must already be prepared: see [`settle`](super::settle). The old one is notified.
    pub(crate) fn replace(&mut self, participant: Box<dyn Participant>) {
        self.terminate(Termination::Replaced);
        self.participant = participant;
        self.orders.begun = true;
    }

    /// Sets the outputs to what a stepper that has just resumed here holds: nothing that was not published.
    pub(crate) fn forget_unpublished(&mut self) {
        if self.next == 0 && self.assignment.interface.kind == Kind::Sampled {
            self.output_buffers.payloads = Outputs::zeroed(&self.assignment.interface).payloads;
        }
    }

    /// Sets the value of input number `input`, which has no link, from the next activation on.
    ///
    /// # Panics
    /// When the input has a link or the size of `payload` is wrong: a mistake of the caller.
    pub(crate) fn set_input(&mut self, input: usize, payload: &[u8]) {
        let fed = self.inputs.iter().any(|link| link.port == input);
        assert!(!fed, "input {input} is fed");
        self.input_buffers.payloads[input].bytes_mut().copy_from_slice(payload);
    }
}
