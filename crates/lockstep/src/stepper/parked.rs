//! A step that is executed by the caller, together with steps of other runs.

use super::progress::Phase;
use super::{StepError, Stepper};
use crate::participant::Pending;

impl Stepper {
    /// From now on leaves steps to the caller, if the participant supports that: [`Stepper::poll`] then stops at
    /// [`Progress::Parked`](super::Progress::Parked) with all inputs received, until the step that [`Stepper::pending`] returns has been
    /// executed.
    pub fn park(&mut self) {
        self.parked.wanted = self.participant.abreast().is_some();
    }

    /// The step that is ready to be executed, if there is one.
    pub fn pending(&mut self) -> Option<Pending<'_>> {
        if self.phase != Phase::Parked || self.parked.result.is_some() {
            return None;
        }
        Some(Pending {
            step: self.parked.step?,
            member: self.participant.abreast()?,
            inputs: &self.input_buffers,
            outputs: &mut self.output_buffers,
            result: &mut self.parked.result,
        })
    }

    /// Continues after a step that the caller has executed. `false` when it has not been executed.
    pub(super) fn take_over(&mut self) -> Result<bool, StepError> {
        let Some(result) = self.parked.result.take() else {
            return Ok(false);
        };
        result.map_err(StepError::Failed)?;
        self.check_outputs()?;
        self.phase = Phase::Record { output: 0 };
        Ok(true)
    }
}
