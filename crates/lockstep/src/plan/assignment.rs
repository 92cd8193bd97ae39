//! Assignments: each participant's part of a plan.

use serde::{Deserialize, Serialize};

use super::{Initial, Link, Observed, Participant, Plan};
use crate::fault::{FaultPort, ScheduledSignalFault};
use crate::link::{Conversion, DeliveryRule, ReadSchedule};
use crate::participant::Interface;
use crate::port::Descriptor;
use crate::time::{SampleTime, Ticks, Timebase};

/// The part of a plan that one participant works from; it receives it before the run starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Assignment {
    /// The participant's name.
    pub name: String,
    /// The tick.
    pub timebase: Timebase,
    /// Its activations.
    pub sample_time: SampleTime,
    /// How many activations lie before the end.
    pub activations: u64,
    /// The ports, which must be those that it reported in the handshake.
    pub interface: Interface,
    /// The links that feed its inputs, in the order of the inputs. An input may have several links, or none.
    pub inputs: Vec<InputLink>,
    /// One entry per output.
    pub outputs: Vec<OutputPort>,
    /// The inputs whose values, as the participant sees them, are recorded on the tape, in the order of the inputs.
    pub seen: Vec<SeenInput>,
}

impl Assignment {
    /// The streams that the participant records on the tape, in the order in which an activation appends them, each with the size of a
    /// payload in bytes.
    pub fn streams(&self) -> impl Iterator<Item = (u32, usize)> + '_ {
        let outputs = self.outputs.iter().zip(&self.interface.outputs);
        let outputs = outputs.map(|(output, port)| (output.stream, port.descriptor.size as usize));
        let inputs = &self.interface.inputs;
        let seen = self.seen.iter();
        outputs.chain(seen.map(|seen| (seen.stream, inputs[seen.input as usize].descriptor.size as usize)))
    }
}

/// A consumer's view of a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputLink {
    /// The number of the input that it feeds.
    pub input: u32,
    /// The number of the link in the plan.
    pub link: u32,
    /// The name of the output, for messages.
    pub from: String,
    /// The delivery rule.
    pub delivery: DeliveryRule,
    /// What is read before anything is visible.
    pub initial: Initial,
    /// The number of samples that fit into the link.
    pub capacity: u32,
    /// Whether a fault at the output may have made its samples NaN or infinite.
    pub has_faults: bool,
    /// The conversion of its samples to fields of the input; without one they are the input.
    pub conversion: Option<Conversion>,
}

impl InputLink {
    /// The message of the link, for an input that takes `takes`.
    pub fn message<'a>(&'a self, takes: &'a Descriptor) -> &'a Descriptor {
        self.conversion.as_ref().map_or(takes, |conversion| &conversion.message)
    }
}

/// An input whose values, as the participant sees them, are recorded on the tape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeenInput {
    /// The number of the input.
    pub input: u32,
    /// The number in the run's list of streams.
    pub stream: u32,
    /// Which of its samples are recorded.
    pub observed: Observed,
    /// The signal faults at the input itself.
    pub faults: Vec<ScheduledSignalFault>,
}

/// A producer's view of an output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutputPort {
    /// The number of the output in the run's list of streams.
    pub stream: u32,
    /// Which of its samples are recorded.
    pub observed: Observed,
    /// The consumers of the output.
    pub consumers: Vec<Consumer>,
    /// The signal faults that are applied to its samples before they are sent.
    pub faults: Vec<ScheduledSignalFault>,
}

/// A producer's view of a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Consumer {
    /// The number of the link in the plan.
    pub link: u32,
    /// The name of the input, for messages.
    pub to: String,
    /// The number of the consuming participant.
    pub participant: u32,
    /// The delivery rule.
    pub delivery: DeliveryRule,
    /// The consumer's activations.
    pub sample_time: SampleTime,
    /// Whether the consumer reads sample 0 before anything is visible.
    pub first_sample: bool,
    /// The number of samples that fit into the link.
    pub capacity: u32,
    /// No activation of the consumer happens at or after this instant, ticks.
    pub end: Ticks,
}

impl Consumer {
    /// The reads of the link.
    pub fn schedule(&self) -> ReadSchedule {
        ReadSchedule::new(self.delivery.clone(), self.sample_time, self.first_sample)
    }
}

impl Plan {
    /// The parts of the plan, one for each participant: links are traversed once for all of them.
    pub fn assignments(&self) -> impl Iterator<Item = Assignment> {
        let outputs = |own: &Participant| vec![Vec::new(); own.interface.outputs.len()];
        let mut readers: Vec<Vec<Vec<usize>>> = self.participants.iter().map(outputs).collect();
        for (number, Link { from, .. }) in self.links.iter().enumerate() {
            readers[from.0][from.1].push(number);
        }
        let all = readers.into_iter().enumerate();
        all.map(|(participant, readers)| self.assignment(participant, &readers))
    }

    /// The part of the plan that participant number `participant` works from, with the links that read each of its outputs.
    fn assignment(&self, participant: usize, readers: &[Vec<usize>]) -> Assignment {
        let own = &self.participants[participant];
        let inputs = own.inputs.iter().enumerate();
        let inputs = inputs.flat_map(|(input, links)| links.iter().map(move |&number| (input, number)));
        let inputs = inputs.map(|(input, number)| {
            let link = &self.links[number];
            InputLink {
                input: input as u32,
                link: number as u32,
                from: self.output_name(link.from),
                delivery: link.delivery.clone(),
                initial: link.initial.clone(),
                capacity: link.capacity as u32,
                has_faults: self.has_output_fault(link.from),
                conversion: link.conversion.clone(),
            }
        });
        let seen = (0..own.inputs.len()).filter_map(|port| {
            let stream = self.seen_stream(participant, port)?;
            Some(SeenInput {
                input: port as u32,
                stream,
                observed: self.observed(stream as usize),
                faults: self.faults_at(FaultPort::Input { participant, port }),
            })
        });
        let outputs = readers.iter().enumerate().map(|(output, readers)| {
            let consumers = readers.iter().map(|&number| (number, &self.links[number]));
            let consumers = consumers.map(|(number, link)| Consumer {
                link: number as u32,
                to: self.input_name(link.to),
                participant: link.to.0 as u32,
                delivery: link.delivery.clone(),
                sample_time: self.participants[link.to.0].sample_time,
                first_sample: link.initial == Initial::FirstSample,
                capacity: link.capacity as u32,
                end: self.end,
            });
            let stream = own.first_stream + output as u32;
            OutputPort {
                stream,
                observed: self.observed(stream as usize),
                consumers: consumers.collect(),
                faults: self.faults_at(FaultPort::Output {
                    participant,
                    port: output,
                }),
            }
        });
        Assignment {
            name: own.name.clone(),
            timebase: self.timebase,
            sample_time: own.sample_time,
            activations: own.activations,
            inputs: inputs.collect(),
            outputs: outputs.collect(),
            seen: seen.collect(),
            interface: own.interface.clone(),
        }
    }
}
