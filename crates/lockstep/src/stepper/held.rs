//! A participant that is held before its step: its inputs can be looked at, and its outputs given in its place.

use super::Stepper;
use super::progress::Phase;

impl Stepper {
    /// Holds it before its next step, and before each one after that: [`Stepper::poll`] gathers the inputs and then says
    /// [`Progress::Held`](super::Progress::Held). One that is held already is let go first.
    pub fn hold(&mut self) {
        self.orders.hold = Some(self.next + u64::from(self.is_held()));
    }

    /// Holds it no more.
    pub fn let_go(&mut self) {
        self.orders.hold = None;
    }

    /// Whether it has the inputs of its next activation, and has not stepped.
    pub fn is_held(&self) -> bool {
        self.phase == Phase::Ready
    }

    /// What input number `input` shows to the activation before which it is held, as the participant sees it.
    ///
    /// # Panics
    /// When there is no such input.
    pub fn shown(&self, input: usize) -> &[u8] {
        self.input_buffers.payloads[input].bytes()
    }

    /// Gives output number `output` of the activation before which it is held: the participant is not stepped then. Outputs that are not given
    /// keep their last value.
    ///
    /// # Panics
    /// When it is not held, or `payload` has another size: a mistake of the caller.
    pub fn answer(&mut self, output: usize, payload: &[u8]) {
        assert!(self.is_held(), "it is not held");
        self.output_buffers.payloads[output]
            .bytes_mut()
            .copy_from_slice(payload);
        self.orders.answered = true;
    }
}
