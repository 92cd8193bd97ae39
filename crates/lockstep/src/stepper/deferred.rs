//! A step that is executed by the caller, together with steps of other runs.

use super::progress::Phase;
use super::{StepError, Stepper};
use crate::participant::PendingStep;

impl Stepper {
    /// From now on leaves steps to the caller, if the participant supports that: [`Stepper::poll`] then stops at
    /// [`Progress::Deferred`](super::Progress::Deferred) with all inputs received, until the step that [`Stepper::pending`] returns has
    /// been executed.
    pub fn defer_steps(&mut self) {
        self.deferred.wanted = self.participant.batch_member().is_some();
    }

    /// The step that is ready to be executed, if there is one.
    pub fn pending(&mut self) -> Option<PendingStep<'_>> {
        if self.phase != Phase::Deferred || self.deferred.result.is_some() {
            return None;
        }
        Some(PendingStep {
            step: self.step,
            member: self.participant.batch_member()?,
            inputs: &self.input_buffers,
            outputs: &mut self.output_buffers,
            result: &mut self.deferred.result,
        })
    }

    /// Continues after a step that the caller has executed. `false` when it has not been executed.
    pub(super) fn finish_deferred_step(&mut self) -> Result<bool, StepError> {
        let Some(result) = self.deferred.result.take() else {
            return Ok(false);
        };
        result.map_err(StepError::Failed)?;
        self.check_outputs()?;
        self.phase = Phase::Record { output: 0 };
        Ok(true)
    }
}
