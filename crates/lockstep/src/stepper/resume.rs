//! Changes while paused: resuming at a position, replacing the participant, setting inputs without a link.

use super::progress::Phase;
use super::{LinkEnds, PositionError, Stepper};
use crate::participant::{Kind, Outputs, Participant, Termination};
use crate::plan::{Assignment, Position};

impl Stepper {
    /// A paused stepper at `position`, after earlier activations were done elsewhere. The participant must already be initialised and
    /// have the state that `position` requires.
    ///
    /// # Errors
    /// When the position does not fit this participant.
    pub fn resume(
        participant: Box<dyn Participant>,
        assignment: Assignment,
        ends: LinkEnds,
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
        stepper.requests.notify_termination = true;
        stepper.phase = Phase::Idle;
        Ok(stepper)
    }

    /// Replaces the participant by `participant`, between two activations: links, schedules and the values of the ports stay as they are.
    /// The new one must already be prepared: see [`prepare_to_resume`](super::prepare_to_resume). The old one is notified.
    pub(crate) fn replace(&mut self, participant: Box<dyn Participant>) {
        self.terminate(Termination::Replaced);
        self.participant = participant;
        self.requests.notify_termination = true;
    }

    /// Sets the outputs to those of a stepper that has just resumed here: values that were not published are cleared.
    pub(crate) fn clear_unpublished_outputs(&mut self) {
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
