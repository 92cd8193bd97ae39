//! Participants and links of a plan, with everything derived for them.

use serde::{Deserialize, Serialize};

use super::Observed;
use crate::fault::{LinkFault, SignalFault};
use crate::link::{Conversion, DeliveryRule, ReadSchedule, Timing};
use crate::participant::Interface;
use crate::port::Descriptor;
use crate::time::{Rational, SampleTime, Ticks, Timebase};

/// What a link delivers before the first sample is visible.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Initial {
    /// This payload; an empty one stands for the zeros of a large input.
    Value(Vec<u8>),
    /// The producer's sample 0, which exists before the run starts. Only for outputs without feedthrough.
    FirstSample,
}

impl Initial {
    /// Zeros, for an input of `size` bytes. Those of a large one are not stored: they would be in every copy of the plan.
    pub fn zero(size: usize) -> Initial {
        match size > Descriptor::PARTS_MAX as usize {
            true => Initial::Value(Vec::new()),
            false => Initial::Value(vec![0; size]),
        }
    }

    /// Whether it is an initial value for an input of `size` bytes.
    pub(super) fn fits(&self, size: usize) -> bool {
        match self {
            Initial::Value(bytes) if bytes.is_empty() => *self == Initial::zero(size),
            Initial::Value(bytes) => bytes.len() == size,
            Initial::FirstSample => true,
        }
    }

    /// The payload of an input of `size` bytes where no sample is read: zero where sample 0 would be read but is lost.
    pub(crate) fn payload(&self, size: usize) -> Vec<u8> {
        match self {
            Initial::Value(bytes) if !bytes.is_empty() => bytes.clone(),
            Initial::Value(_) | Initial::FirstSample => vec![0; size],
        }
    }
}

/// A participant and its data in the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Participant {
    /// The name, unique in the run.
    pub name: String,
    /// The ports.
    pub interface: Interface,
    /// The period as the user wrote it.
    pub period: Rational,
    /// The first activation as the user wrote it.
    pub offset: Rational,
    /// The activations in ticks.
    pub sample_time: SampleTime,
    /// How many activations lie before the end.
    pub activations: u64,
    /// Among activations at the same instant, lower ranks come first.
    pub rank: u32,
    /// The links that feed each input: none, if it need not be connected; one; or several, each of which feeds some of its fields.
    pub inputs: Vec<Vec<usize>>,
    /// The number of the first output in the run's list of streams; the others follow.
    pub first_stream: u32,
}

/// A connection of one output to one input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// The name in the scenario.
    pub name: String,
    /// Participant and output number.
    pub from: (usize, usize),
    /// Participant and input number.
    pub to: (usize, usize),
    /// The timing as the user wrote it.
    pub timing: Timing,
    /// The link faults, as the user wrote them.
    pub faults: Vec<LinkFault>,
    /// The delivery rule in ticks.
    pub delivery: DeliveryRule,
    /// What is read before anything is visible.
    pub initial: Initial,
    /// The conversion of its samples to fields of the input; without one they are the input.
    pub conversion: Option<Conversion>,
    /// How many samples may be in flight: enough for the delay, so that participants never wait for room in a cycle.
    pub capacity: usize,
}

/// An input whose values, as the participant saw them, are on the tape: a sample for each activation, stamped with its instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Seen {
    /// The participant.
    pub participant: usize,
    /// The input.
    pub input: usize,
}

/// The plan of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// The tick.
    pub timebase: Timebase,
    /// No activation happens at or after this instant.
    pub end: Ticks,
    /// The seed of every random stream.
    pub seed: u64,
    /// The participants in the order of the scenario.
    pub participants: Vec<Participant>,
    /// The links.
    pub links: Vec<Link>,
    /// The signal faults, in the order of the scenario.
    pub faults: Vec<SignalFault>,
    /// The inputs that a signal fault may change, as participants see them: streams behind those of the outputs, in this order.
    pub seen: Vec<Seen>,
    /// Which samples of each stream are observed; a stream that is missing is observed in full.
    pub observed: Vec<Observed>,
}

impl Plan {
    /// The reads of link number `link`.
    pub fn schedule(&self, link: usize) -> ReadSchedule {
        let link = &self.links[link];
        let consumer = self.participants[link.to.0].sample_time;
        ReadSchedule::new(link.delivery.clone(), consumer, link.initial == Initial::FirstSample)
    }

    /// The links that feed the inputs of participant number `participant`, in the order of its assignment.
    pub fn links_into(&self, participant: usize) -> impl Iterator<Item = usize> {
        self.participants[participant].inputs.iter().flatten().copied()
    }

    /// `producer.port` or `consumer.port`.
    pub fn output_name(&self, (participant, output): (usize, usize)) -> String {
        let participant = &self.participants[participant];
        format!("{}.{}", participant.name, participant.interface.outputs[output].name)
    }

    /// `consumer.port`.
    pub fn input_name(&self, (participant, input): (usize, usize)) -> String {
        let participant = &self.participants[participant];
        format!("{}.{}", participant.name, participant.interface.inputs[input].name)
    }

    /// The number of the participant called `name`.
    pub fn participant(&self, name: &str) -> Option<usize> {
        self.participants
            .iter()
            .position(|participant| participant.name == name)
    }

    /// Which samples of stream number `stream` are observed.
    pub fn observed(&self, stream: usize) -> Observed {
        self.observed.get(stream).copied().unwrap_or(Observed::ALL)
    }

    /// The payload sizes, bytes, of the streams that participant number `participant` records on the tape.
    pub fn recorded_sizes(&self, participant: usize) -> impl Iterator<Item = usize> {
        let Interface { inputs, outputs, .. } = &self.participants[participant].interface;
        let outputs = outputs.iter().map(|port| port.descriptor.size as usize);
        let first = self.seen.partition_point(|seen| seen.participant < participant);
        let seen = self.seen[first..]
            .iter()
            .take_while(move |seen| seen.participant == participant);
        outputs.chain(seen.map(|seen| inputs[seen.input].descriptor.size as usize))
    }

    /// How many streams the run has: one for each output, and one for each input that a fault may disturb.
    pub fn stream_count(&self) -> usize {
        self.output_count() + self.seen.len()
    }

    pub(super) fn output_count(&self) -> usize {
        self.participants
            .iter()
            .map(|participant| participant.interface.outputs.len())
            .sum()
    }
}
