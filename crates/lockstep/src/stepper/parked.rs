//! A step that is done beside those of other runs.

use super::progress::Phase;
use super::{StepError, Stepper};
use crate::participant::Pending;

impl Stepper {
    /// From now on steps are left to others, if the participant allows it: [`Stepper::poll`] then stops
    /// at [`Progress::Parked`](super::Progress::Parked) with everything come in, until what [`Stepper::pending`] gives has been stepped.
    pub fn park(&mut self) {
        self.parked.wanted = self.participant.abreast().is_some();
    }

    /// The step that waits to be done, if one does.
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

    /// Goes on behind a step that others have done. `false` when it has not been done.
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
