//! The end of a participant's part in a run: it is told once, whatever drives it and whatever has happened.

use std::sync::Arc;

use super::termination::terminate;
use super::{StepError, Stepper};
use crate::participant::{Failure, Inputs, Interface, Kind, Log, Outputs, Participant, Sink, Step, Termination};

impl Stepper {
    /// Where the participant's lines go; without it to standard error.
    pub fn log_to(&mut self, sink: &Arc<dyn Sink>) {
        self.output_buffers.log = Log::new(&self.assignment.name, Some(sink.clone()));
    }

    /// Tells the participant that its part is over, unless it was told before. When the stepper is dropped this is done too: the participant has
    /// finished, or was stopped.
    pub fn terminate(&mut self, why: Termination) {
        if std::mem::take(&mut self.orders.begun) {
            let log = self.output_buffers.log.clone().at(self.next_seconds());
            terminate(self.participant.as_mut(), why, &log);
        }
    }

    /// The participant, without its links. It has not been told that its part is over.
    pub fn into_participant(mut self) -> Box<dyn Participant> {
        self.orders.begun = false;
        std::mem::replace(&mut self.participant, Box::new(Vacant))
    }

    /// `done`; a participant that has panicked may be torn, and is not called again.
    pub(super) fn whole(&mut self, done: Result<(), StepError>) -> Result<(), StepError> {
        self.orders.begun &= !matches!(done, Err(StepError::Panicked(_)));
        done
    }
}

impl Drop for Stepper {
    fn drop(&mut self) {
        let finished = self.next >= self.assignment.activations;
        self.terminate(if finished {
            Termination::Finished
        } else {
            Termination::Stopped
        });
    }
}

/// What is left where a participant was taken out.
struct Vacant;

impl Participant for Vacant {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
    }

    fn step(&mut self, _: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
}
