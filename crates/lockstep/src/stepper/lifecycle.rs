//! The end of a participant's part in a run: the participant is notified exactly once, in every executor and after every failure.

use std::sync::Arc;

use super::termination::terminate;
use super::{StepError, Stepper};
use crate::participant::{Failure, Inputs, Interface, Kind, Log, Outputs, Participant, Sink, Step, Termination};

impl Stepper {
    /// Sets the destination of the participant's log lines; without a call they go to standard error.
    pub fn log_to(&mut self, sink: &Arc<dyn Sink>) {
        self.output_buffers.log = Log::new(&self.assignment.name, Some(sink.clone()));
    }

    /// Notifies the participant that its part is over, unless it has been notified before. Dropping the stepper does this too: the
    /// participant has then finished, or was stopped.
    pub fn terminate(&mut self, why: Termination) {
        if std::mem::take(&mut self.requests.notify_termination) {
            let log = self.output_buffers.log.clone().at(self.next_seconds());
            terminate(self.participant.as_mut(), why, &log);
        }
    }

    /// Returns the participant without its links. It has not been notified that its part is over.
    pub fn into_participant(mut self) -> Box<dyn Participant> {
        self.requests.notify_termination = false;
        std::mem::replace(&mut self.participant, Box::new(Placeholder))
    }

    /// Ends the participant's part as a drop does, but does not close the links: for a process that is about to exit.
    pub fn leave_open(mut self) {
        self.terminate(self.reason_of_end());
        drop(std::mem::replace(&mut self.participant, Box::new(Placeholder)));
        std::mem::forget(self);
    }

    fn reason_of_end(&self) -> Termination {
        if self.next >= self.assignment.activations {
            Termination::Finished
        } else {
            Termination::Stopped
        }
    }

    /// Returns `done`. A participant that has panicked may be in an inconsistent state, and is not called again.
    pub(super) fn note_panic(&mut self, done: Result<(), StepError>) -> Result<(), StepError> {
        self.requests.notify_termination &= !matches!(done, Err(StepError::Panicked(_)));
        done
    }
}

impl Drop for Stepper {
    fn drop(&mut self) {
        self.terminate(self.reason_of_end());
    }
}

/// The placeholder for a participant that was taken out.
struct Placeholder;

impl Participant for Placeholder {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
    }

    fn step(&mut self, _: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }
}
