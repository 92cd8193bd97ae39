//! A cut through a run: the next activation of every participant, and the samples in flight to it.
//!
//! Which samples an input still needs is a pure function of the plan, and every sample is on the tape, or retained separately where the tape
//! omits some. So the queues of the links need not be saved: they are read back. All users of a cut therefore resume in the same way: a
//! resumed run, a restart after a participant has died, a substitution during the run.

use serde::{Deserialize, Serialize};

use super::{Initial, Plan};
use crate::link::ReadSchedule;
use crate::participant::Kind;
use crate::time::Ticks;

/// How many activations each participant has completed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// The next activation of each participant, in the order of the plan.
    pub next: Vec<u64>,
}

/// One sample in flight to an input.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InFlightSample {
    /// Its index in the output's sequence.
    pub index: u64,
    /// The payload.
    pub payload: Vec<u8>,
}

/// The state of the faults of each port: for each fault, in the order of the plan, the values at which its elements are stuck.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StuckValues {
    /// For each input.
    pub inputs: Vec<Vec<Vec<u8>>>,
    /// For each output.
    pub outputs: Vec<Vec<Vec<u8>>>,
}

/// Everything besides its own state that a participant needs to continue from a cut.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// The next activation; all before it are complete.
    pub next: u64,
    /// For each link that feeds an input, in the order of the assignment, the samples that were sent before and that it still reads,
    /// oldest first.
    pub inputs: Vec<Vec<InFlightSample>>,
    /// For each input without a link, its value; empty where none was set and the input holds zero bytes.
    pub values: Vec<Vec<u8>>,
    /// The value of each output: its newest sample. Empty where there is none yet.
    pub outputs: Vec<Vec<u8>>,
    /// The values at which elements of its ports are stuck.
    pub held: StuckValues,
    /// The participant's own saved state. `None`: it keeps the state it has, or, if it has just been created, is initialised at this
    /// instant.
    pub state: Option<Vec<u8>>,
}

impl Plan {
    /// The cut at which every participant has done exactly the activations before `horizon`.
    pub fn cut_at(&self, horizon: Ticks) -> Cut {
        let next = self.participants.iter();
        Cut {
            next: next
                .map(|own| own.sample_time.count_before(horizon.min(self.end)))
                .collect(),
        }
    }

    /// How many samples each output of participant number `participant` has when its next activation is `next`.
    pub fn samples_before(&self, participant: usize, next: u64) -> u64 {
        let own = &self.participants[participant];
        match own.interface.kind {
            Kind::Continuous if own.activations > 0 => next + 1,
            _ => next,
        }
    }

    /// The next activation of a participant whose outputs have `samples` samples each; the inverse of
    /// [`Plan::samples_before`].
    pub fn activations_of(&self, participant: usize, samples: u64) -> u64 {
        match self.participants[participant].interface.kind {
            Kind::Continuous => samples.saturating_sub(1),
            Kind::Sampled => samples,
        }
    }

    /// The samples of link number `link` that its consumer still reads at `cut`, of those that its producer has sent.
    fn in_flight(&self, cut: &Cut, link: usize) -> Vec<u64> {
        let link = &self.links[link];
        let sent_count = self.samples_before(link.from.0, cut.next[link.from.0]);
        let consumer = &self.participants[link.to.0];
        let Some(newest) = sent_count.checked_sub(1) else {
            return Vec::new();
        };
        // From this instant on, an activation reads the newest sample that was sent, or a later one, or none of these.
        let settled = link
            .delivery
            .producer()
            .instant(newest)
            .saturating_add(link.delivery.delay_bounds().1);
        let mut schedule = ReadSchedule::new(
            link.delivery.clone(),
            consumer.sample_time,
            link.initial == Initial::FirstSample,
        );
        schedule.skip_to(cut.next[link.to.0]);
        let mut in_flight: Vec<u64> = Vec::new();
        while schedule.next_activation() < consumer.activations {
            let t = consumer.sample_time.instant(schedule.next_activation());
            let mut samples = schedule.advance().samples().peekable();
            if samples.peek().is_some_and(|&first| first >= sent_count) {
                break;
            }
            for index in samples.filter(|&index| index < sent_count) {
                if in_flight.last().is_none_or(|&last| last < index) {
                    in_flight.push(index);
                }
            }
            if t >= settled {
                break;
            }
        }
        in_flight
    }

    /// The position of participant number `participant` at `cut`. `sample` reads one sample back from the tape, by the number of its
    /// stream and its index.
    ///
    /// # Errors
    /// The error of `sample`.
    pub fn position<E>(
        &self,
        cut: &Cut,
        participant: usize,
        mut sample: impl FnMut(u32, u64) -> Result<Vec<u8>, E>,
    ) -> Result<Position, E> {
        let own = &self.participants[participant];
        let mut inputs = Vec::with_capacity(own.inputs.len());
        for &link in own.inputs.iter().flatten() {
            let mut backlog = Vec::new();
            let (producer, output) = self.links[link].from;
            let stream = self.participants[producer].first_stream + output as u32;
            for index in self.in_flight(cut, link) {
                let payload = self.sent_sample((producer, output), index, &mut |index| sample(stream, index))?;
                backlog.push(InFlightSample { index, payload });
            }
            inputs.push(backlog);
        }
        let newest = self.samples_before(participant, cut.next[participant]).checked_sub(1);
        let mut outputs = Vec::with_capacity(own.interface.outputs.len());
        for (number, _) in own.interface.outputs.iter().enumerate() {
            outputs.push(match newest {
                Some(index) => sample(own.first_stream + number as u32, index)?,
                None => Vec::new(),
            });
        }
        Ok(Position {
            next: cut.next[participant],
            inputs,
            values: vec![Vec::new(); own.inputs.len()],
            outputs,
            held: self.stuck_values(cut, participant, &mut sample)?,
            state: None,
        })
    }
}
