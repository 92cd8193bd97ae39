//! Checks of the events in which participants report their progress against the plan and their recorded samples.

use lockstep::time::Ticks;
use lockstep::transport::TransportError;

use super::recorder::{Recorder, samples};

impl Recorder {
    /// Checks the event Finished of participant number `participant` against its recorded samples.
    ///
    /// # Errors
    /// The contradiction, in words that follow the participant's name.
    pub fn check_finished(&self, participant: usize) -> Result<(), TransportError> {
        let planned = &self.plan.participants[participant];
        let says = "reports that it has finished";
        let last = planned
            .activations
            .checked_sub(1)
            .map(|last| planned.sample_time.instant(last));
        if last.is_some_and(|last| last >= self.granted) {
            return Err(TransportError(format!(
                "{says}; it is granted no time after t = {} s",
                self.plan.timebase.seconds(self.granted)
            )));
        }
        self.check_sample_counts(participant, planned.activations, says)
    }

    /// Checks the event AtHorizon (granted time and next activation) against the plan and the recorded samples.
    ///
    /// # Errors
    /// As [`Recorder::check_finished`].
    pub fn check_at_horizon(&self, participant: usize, horizon: Ticks, next: u64) -> Result<(), TransportError> {
        let t = self.plan.timebase.seconds(horizon);
        let says = format!("reports that it rests at t = {t} s");
        if horizon > self.granted {
            return Err(TransportError(format!(
                "{says}; it is granted no time after t = {} s",
                self.plan.timebase.seconds(self.granted)
            )));
        }
        let planned = &self.plan.participants[participant];
        let before = planned.sample_time.count_before(horizon.min(self.plan.end));
        let right = before.max(self.base_activations[participant]);
        if next != right {
            return Err(TransportError(format!(
                "{says} before its activation {next}; by the plan it rests there before activation {right}"
            )));
        }
        self.check_sample_counts(participant, next, &says)
    }

    /// Checks the event Paused (next activation) against the recorded samples.
    ///
    /// # Errors
    /// As [`Recorder::check_finished`].
    pub fn check_paused(&self, participant: usize, next: u64) -> Result<(), TransportError> {
        let (least, most) = (
            self.base_activations[participant],
            self.plan.participants[participant].activations,
        );
        let says = format!("reports that it rests before its activation {next}");
        if !(least..=most).contains(&next) {
            return Err(TransportError(format!(
                "{says}, of those from {least} to {most} that it may have reached"
            )));
        }
        self.check_sample_counts(participant, next, &says)
    }

    /// Checks that the participant has recorded exactly the samples of the activations before `next`.
    fn check_sample_counts(&self, participant: usize, next: u64, says: &str) -> Result<(), TransportError> {
        let owned = self.owners.iter().enumerate();
        for (stream, _) in owned.filter(|(_, owner)| **owner == participant) {
            let (due, right) = (self.published[stream], samples(&self.plan, stream, participant, next));
            if due != right {
                let name = self.name(stream);
                return Err(TransportError(format!(
                    "{says}, and has recorded {due} samples of `{name}` where the plan has {right}"
                )));
            }
        }
        Ok(())
    }
}
