//! The execution of a step.

use super::progress::Phase;
use super::{StepError, Stepper, catch_failure};
use crate::participant::{Kind, Step};
use crate::plan::Assignment;

impl Stepper {
    /// Does the step whose inputs are complete: executed here, left to the caller, or provided from outside.
    pub(super) fn do_step(&mut self) -> Result<(), StepError> {
        let step = self.step;
        self.output_buffers.log.set_time(step.t);
        if !std::mem::take(&mut self.requests.outputs_provided) {
            if self.deferred.wanted {
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

    /// Begins the next activation: determines its instants and which of its outputs are seen. All of this follows from the plan, so it is
    /// done before the inputs arrive, and the time between their arrival and the step is short.
    pub(super) fn begin_activation(&mut self) {
        if self.step.index == self.next {
            return; // the participant has paused since
        }
        let Assignment {
            timebase,
            sample_time,
            interface,
            ..
        } = &self.assignment;
        let seconds = |k| timebase.seconds(sample_time.instant(k));
        let is_following = self.step.index.wrapping_add(1) == self.next;
        self.step = Step {
            index: self.next,
            t: if is_following {
                self.step.t_next
            } else {
                seconds(self.next)
            },
            t_next: seconds(self.next + 1),
            period: self.step.period,
        };
        self.sample = match interface.kind {
            Kind::Sampled => self.next,
            Kind::Continuous => self.next + 1,
        };
        self.update_seen_outputs();
    }
}
