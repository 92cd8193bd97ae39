//! A pause before a step: a program can look at its inputs and provide its outputs in place of the step.

use super::Stepper;
use super::progress::Phase;

impl Stepper {
    /// Pauses the participant before its next step, and before each one after that: [`Stepper::poll`] gathers the inputs and then returns
    /// [`Progress::BeforeStep`](super::Progress::BeforeStep). If it is already paused, it is first released from that step.
    pub fn pause_before_step(&mut self) {
        self.requests.pause_from = Some(self.next + u64::from(self.is_before_step()));
    }

    /// No longer pauses the participant.
    pub fn release(&mut self) {
        self.requests.pause_from = None;
    }

    /// Whether the participant has the inputs of its next activation and has not been stepped.
    pub fn is_before_step(&self) -> bool {
        self.phase == Phase::Ready
    }

    /// The value of input number `input`, as the participant sees it at the activation before whose step it is paused.
    ///
    /// # Panics
    /// When there is no such input.
    pub fn input_value(&self, input: usize) -> &[u8] {
        self.input_buffers.payloads[input].bytes()
    }

    /// Provides output number `output` of the activation before whose step the participant is paused: the participant is then not stepped.
    /// Outputs that are not provided keep their last value.
    ///
    /// # Panics
    /// When the participant is not paused before its step, or the size of `payload` is wrong: a mistake of the caller.
    pub fn set_output(&mut self, output: usize, payload: &[u8]) {
        assert!(self.is_before_step(), "it is not paused");
        self.output_buffers.payloads[output]
            .bytes_mut()
            .copy_from_slice(payload);
        self.requests.outputs_provided = true;
    }
}
