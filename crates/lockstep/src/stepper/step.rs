//! The execution of a step.

use super::progress::Phase;
use super::{StepError, Stepper, catch_failure};
use crate::participant::{Kind, Step};
use crate::plan::Assignment;

impl Stepper {
    /// Does the step whose inputs are complete: executed here, left to the caller, or provided from outside.
    pub(super) fn do_step(&mut self) -> Result<(), StepError> {
        let step = self.begin_step();
        if !std::mem::take(&mut self.requests.outputs_provided) {
            if self.deferred.wanted {
                self.deferred.step = Some(step);
                self.phase = Phase::Deferred;
                return Ok(());
            }
            let Stepper {
                participant,
                input_buffers,
                output_buffers,
                ..
            } = self;
            let done = catch_failure(|| participant.step(&step, input_buffers, output_buffers));
            self.note_panic(done)?;
        }
        self.check_outputs()?;
        self.phase = Phase::Record { output: 0 };
        Ok(())
    }

    /// Begins the activation that is about to be stepped, and shows the participant which of its outputs are seen.
    fn begin_step(&mut self) -> Step {
        let Assignment {
            timebase,
            sample_time,
            interface,
            ..
        } = &self.assignment;
        let seconds = |k| timebase.seconds(sample_time.instant(k));
        let (known, t) = self.known_instant_s;
        let step = Step {
            index: self.next,
            t: if known == self.next { t } else { seconds(self.next) },
            t_next: seconds(self.next + 1),
            period: self.period_s,
        };
        self.known_instant_s = (self.next + 1, step.t_next);
        self.sample = match interface.kind {
            Kind::Sampled => self.next,
            Kind::Continuous => self.next + 1,
        };
        self.update_seen_outputs();
        self.output_buffers.log.set_time(step.t);
        step
    }
}
