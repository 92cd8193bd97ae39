//! Executors in one process: a plain loop, and a thread for each participant.
//!
//! Both drive the same [`Stepper`]s over local links. The processes over shared memory are driven by [`crate::host`].

mod in_loop;
mod threads;

pub use in_loop::InLoop;
pub use threads::run_in_threads;

use crate::participant::Participant;
use crate::plan::Plan;
use crate::stepper::{Ends, StepError, Stepper};
use crate::transport::{Receiver, Recording, Sender, local};

/// Why a run in one process ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A participant failed.
    #[error("participant `{participant}` failed at t = {t} s (activation {activation}): {source}")]
    Participant {
        /// Who.
        participant: String,
        /// The instant of the activation, s.
        t: f64,
        /// The number of the activation.
        activation: u64,
        /// Why.
        source: StepError,
    },
    /// Nobody can go on. This is a mistake in the plan, not in a participant.
    #[error(
        "nobody can go on at t = {t} s; {waiting} (this is a defect of the planner: please report it with the scenario)"
    )]
    Stuck {
        /// The earliest instant, s.
        t: f64,
        /// Who waits for what.
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

/// Connects the participants of a plan inside this process. `recording` gives each its way to the tape.
pub fn assemble(
    plan: &Plan,
    participants: Vec<Box<dyn Participant>>,
    mut recording: impl FnMut(usize) -> Box<dyn Recording>,
) -> Vec<Stepper> {
    let mut senders: Vec<Option<Box<dyn Sender>>> = Vec::new();
    let mut receivers: Vec<Option<Box<dyn Receiver>>> = Vec::new();
    for link in &plan.links {
        let size = plan.participants[link.from.0].interface.outputs[link.from.1]
            .descriptor
            .size as usize;
        let (sender, receiver) = local::link(size, link.capacity);
        senders.push(Some(Box::new(sender)));
        receivers.push(Some(Box::new(receiver)));
    }
    let mut steppers = Vec::with_capacity(participants.len());
    for (number, participant) in participants.into_iter().enumerate() {
        let assignment = plan.assignment(number);
        let mut ends = Ends {
            receivers: Vec::new(),
            senders: Vec::new(),
            recording: recording(number),
        };
        for link in &assignment.inputs {
            ends.receivers
                .push(link.as_ref().and_then(|link| receivers[link.link as usize].take()));
        }
        for output in &assignment.outputs {
            let consumers = output.consumers.iter();
            ends.senders.push(
                consumers
                    .filter_map(|consumer| senders[consumer.link as usize].take())
                    .collect(),
            );
        }
        steppers.push(Stepper::new(participant, assignment, ends));
    }
    steppers
}
