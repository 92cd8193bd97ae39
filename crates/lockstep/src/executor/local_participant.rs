//! A participant with its ends of local links, and why a run in one process ends early.

use crate::participant::Participant;
use crate::plan::{Assignment, Plan, Position};
use crate::stepper::{LinkEnds, PositionError, StepError, Stepper};
use crate::transport::local::{self, LocalReceiver, LocalSender};
use crate::transport::{Receiver, Recording, Sender};

/// Why a run in one process ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A participant failed.
    #[error("participant `{participant}` failed at t = {t} s (activation {activation}): {source}")]
    Participant {
        /// The name of the participant.
        participant: String,
        /// The instant of the activation, s.
        t: f64,
        /// The number of the activation.
        activation: u64,
        /// Why.
        source: StepError,
    },
    /// No participant can continue. This is a mistake in the plan, not in a participant.
    #[error(
        "no participant can continue at t = {t} s; {waiting} (this is a defect of the planner: please report it with the scenario)"
    )]
    Deadlock {
        /// The earliest instant, s.
        t: f64,
        /// The participants that wait, and what each of them waits for.
        waiting: String,
    },
}

impl RunError {
    pub(crate) fn of(stepper: &Stepper, source: StepError) -> RunError {
        RunError::Participant {
            participant: stepper.assignment().name.clone(),
            t: stepper.next_seconds(),
            activation: stepper.next_activation(),
            source,
        }
    }
}

/// A participant with its ends of local links, before an executor drives it.
pub struct LocalParticipant {
    participant: Box<dyn Participant>,
    assignment: Assignment,
    receivers: Vec<LocalReceiver>,
    senders: Vec<Vec<LocalSender>>,
    recording: Box<dyn Recording + Send>,
}

impl LocalParticipant {
    /// The stepper of this participant.
    pub fn into_stepper(self) -> Stepper {
        let (participant, assignment, ends) = self.into_ends();
        Stepper::new(participant, assignment, ends)
    }

    /// The stepper of this participant, resumed at `position` after earlier activations were done elsewhere.
    pub fn into_stepper_at(self, position: Position) -> Result<Stepper, PositionError> {
        let (participant, assignment, ends) = self.into_ends();
        Stepper::resume(participant, assignment, ends, position)
    }

    fn into_ends(self) -> (Box<dyn Participant>, Assignment, LinkEnds) {
        let boxed = |sender| Box::new(sender) as Box<dyn Sender>;
        let ends = LinkEnds {
            receivers: self
                .receivers
                .into_iter()
                .map(|end| Box::new(end) as Box<dyn Receiver>)
                .collect(),
            senders: self
                .senders
                .into_iter()
                .map(|ends| ends.into_iter().map(boxed).collect())
                .collect(),
            recording: self.recording,
        };
        (self.participant, self.assignment, ends)
    }
}

/// Connects the participants of a plan inside this process. `recording` returns the recording of each.
pub fn connect_locally(
    plan: &Plan,
    participants: Vec<Box<dyn Participant>>,
    mut recording: impl FnMut(usize) -> Box<dyn Recording + Send>,
) -> Vec<LocalParticipant> {
    let (mut senders, mut receivers) = (Vec::new(), Vec::new());
    for link in &plan.links {
        let size = plan.participants[link.from.0].interface.outputs[link.from.1]
            .descriptor
            .size as usize;
        let (sender, receiver) = local::link(size, link.capacity);
        senders.push(Some(sender));
        receivers.push(Some(receiver));
    }
    let mut parts = Vec::with_capacity(participants.len());
    for (number, (participant, assignment)) in participants.into_iter().zip(plan.assignments()).enumerate() {
        let own = assignment.inputs.iter();
        let receivers = own.filter_map(|link| receivers[link.link as usize].take()).collect();
        let own = assignment.outputs.iter();
        let senders = own
            .map(|output| {
                output
                    .consumers
                    .iter()
                    .filter_map(|to| senders[to.link as usize].take())
                    .collect()
            })
            .collect();
        parts.push(LocalParticipant {
            participant,
            assignment,
            receivers,
            senders,
            recording: recording(number),
        });
    }
    parts
}
