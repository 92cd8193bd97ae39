//! Random plans, a participant whose outputs depend on everything it ever read, and a reference executor that is simple
//! enough to be obviously right.

mod conversion;
mod faults;
mod mixed;

use std::sync::{Arc, Mutex};

use lockstep::fault::{FaultPort, LinkFault};
use lockstep::link::{Hold, Timing};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, Participant, Step};
use lockstep::plan::{Initial, LinkSpec, ParticipantSpec, Plan, PlanError};
use lockstep::time::{Rational, Ticks};
use lockstep::transport::{Header, Recording, TransportError};
use proptest::prelude::*;

use conversion::{LinkConversion, ReceivedSample};
pub use mixed::Mixed;
use mixed::time;

/// Hashes the inputs of every activation into its state and writes it to its outputs where they are seen.
pub struct HashingParticipant {
    kind: Kind,
    inputs: usize,
    outputs: usize,
    state: u64,
}

impl HashingParticipant {
    pub fn new(kind: Kind, inputs: usize, outputs: usize, number: u64) -> HashingParticipant {
        HashingParticipant {
            kind,
            inputs,
            outputs,
            state: number.wrapping_mul(0x9e37_79b9) + 1,
        }
    }

    fn write(&self, t: f64, outputs: &mut Outputs) {
        for port in 0..self.outputs {
            if !outputs.is_seen(port) {
                *outputs.get_mut::<Mixed>(port) = Mixed {
                    hash: u64::MAX,
                    x: f64::NAN,
                };
                continue;
            }
            let hash = (self.state ^ t.to_bits()).wrapping_add(port as u64);
            *outputs.get_mut::<Mixed>(port) = Mixed {
                hash,
                x: (hash >> 20) as f64,
            };
        }
    }
}

impl Participant for HashingParticipant {
    fn interface(&self) -> Interface {
        let mut interface = Interface::new(self.kind);
        for port in 0..self.inputs {
            interface = interface.optional_input::<Mixed>(&format!("in{port}"));
        }
        for port in 0..self.outputs {
            interface = interface.output::<Mixed>(&format!("out{port}"));
        }
        interface
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.write(t, outputs);
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        for port in 0..self.inputs {
            let input = inputs.get::<Mixed>(port);
            self.state = (self.state ^ input.hash ^ input.x.to_bits())
                .wrapping_mul(0x0100_0000_01b3)
                .rotate_left(17);
        }
        self.state ^= step.t.to_bits();
        self.write(
            if self.kind == Kind::Sampled {
                step.t
            } else {
                step.t_next
            },
            outputs,
        );
        Ok(())
    }
}

/// The recorded samples of a run with their stamps, for every stream.
pub type Tape = Vec<Vec<(u64, Ticks, Vec<u8>)>>;

/// A recording that several participants share.
#[derive(Clone)]
pub struct SharedTape(pub Arc<Mutex<Tape>>);

impl SharedTape {
    pub fn new(plan: &Plan) -> SharedTape {
        SharedTape(Arc::new(Mutex::new(vec![Vec::new(); plan.stream_count()])))
    }
    pub fn take(&self) -> Tape {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

impl Recording for SharedTape {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        self.0.lock().unwrap()[stream as usize].push((header.index, header.stamp, payload.to_vec()));
        Ok(true)
    }
}

/// A description from which a plan and fresh participants can be made any number of times.
#[derive(Debug, Clone)]
pub struct RandomScenario {
    pub participant_specs: Vec<(Kind, Rational, Rational, usize, usize)>,
    pub links: Vec<(usize, usize, usize, usize, Timing, bool, LinkConversion)>,
    pub duration: Rational,
    pub seed: u64,
    pub faults: faults::Faults,
}

impl RandomScenario {
    fn link_faults(&self, link: usize) -> Vec<LinkFault> {
        let own = self.faults.links.iter().filter(|(at, _)| *at == link);
        own.map(|(_, fault)| fault.clone()).collect()
    }

    pub fn participants(&self) -> Vec<Box<dyn Participant>> {
        let participant_specs = self.participant_specs.iter().enumerate();
        participant_specs
            .map(|(number, &(kind, _, _, inputs, outputs))| {
                Box::new(HashingParticipant::new(kind, inputs, outputs, number as u64)) as Box<dyn Participant>
            })
            .collect()
    }

    pub fn plan(&self) -> Result<Plan, Vec<PlanError>> {
        let mut taken: Vec<((usize, usize), LinkConversion)> = Vec::new();
        let mut links = Vec::new();
        for (number, &(from, output, to, input, timing, first, conversion_kind)) in self.links.iter().enumerate() {
            let (from, to) = (from % self.participant_specs.len(), to % self.participant_specs.len());
            let (output, input) = (
                output % self.participant_specs[from].4,
                input % self.participant_specs[to].3.max(1),
            );
            let compatible = |&(port, other): &((usize, usize), LinkConversion)| {
                port != (to, input) || conversion_kind.is_compatible_with(other)
            };
            if self.participant_specs[to].3 == 0 || !taken.iter().all(compatible) {
                continue;
            }
            taken.push(((to, input), conversion_kind));
            let first = first
                && self.participant_specs[from].0 == Kind::Continuous
                && self.participant_specs[from].2 <= self.participant_specs[to].2;
            links.push(LinkSpec {
                name: format!("link{number}"),
                from: (format!("p{from}"), format!("out{output}")),
                to: (format!("p{to}"), format!("in{input}")),
                timing,
                initial: if first {
                    Some(Initial::FirstSample)
                } else {
                    Some(Initial::Value(vec![number as u8; 16]))
                },
                conversion: conversion_kind.conversion(),
                random_stream: conversion_kind.conversion().map(|_| format!("c{number}")),
                faults: self.link_faults(number),
            });
        }
        let specs =
            self.participant_specs
                .iter()
                .enumerate()
                .map(|(number, &(kind, period, offset, inputs, outputs))| {
                    let interface = HashingParticipant::new(kind, inputs, outputs, 0).interface();
                    ParticipantSpec {
                        name: format!("p{number}"),
                        period,
                        offset,
                        interface,
                    }
                });
        let mut plan = Plan::build(specs.collect(), &links, self.duration, self.seed)?;
        plan.add_signal_faults(self.faults.signals(&plan))?;
        Ok(plan)
    }
}

/// Scenarios of 1 to 6 participants with any mix of kinds, periods, offsets, delays, jitter, drops and conversions.
pub fn random_scenarios() -> impl Strategy<Value = RandomScenario> {
    let kind = prop_oneof![Just(Kind::Sampled), Just(Kind::Continuous)];
    let participant_spec = (kind, time(1..12), time(0..10), 0_usize..4, 1_usize..3);
    let timing = (
        time(0..30),
        prop_oneof![3 => Just(Rational::ZERO), 1 => time(0..20)],
        prop_oneof![3 => Just(0.0), 1 => 0.0..1.0],
        prop_oneof![Just(Hold::Last), Just(Hold::Initial), Just(Hold::Linear)],
    )
        .prop_map(|(delay, jitter, drop, hold)| Timing {
            delay,
            jitter,
            drop,
            hold,
        });
    let zero = Just(Timing::default());
    let link = (
        0_usize..6,
        0_usize..2,
        0_usize..6,
        0_usize..3,
        prop_oneof![1 => timing, 1 => zero],
        any::<bool>(),
        conversion::link_conversions(),
    );
    (
        prop::collection::vec(participant_spec, 1..7),
        prop::collection::vec(link, 0..12),
        time(20..90),
        any::<u64>(),
        faults::faults(),
    )
        .prop_map(|(participant_specs, links, duration, seed, faults)| RandomScenario {
            participant_specs,
            links,
            duration,
            seed,
            faults,
        })
}

/// The reference: keeps every sample of every output for ever, and for every read searches all of them for the newest that
/// is visible. Activations of one instant are tried in any order until all have what they need.
pub fn reference(scenario: &RandomScenario, plan: &Plan) -> Tape {
    let mut participants = scenario.participants();
    let mut tape: Tape = vec![Vec::new(); plan.stream_count()];
    let record = |tape: &mut Tape, number: usize, index: u64, outputs: &Outputs| {
        let own = &plan.participants[number];
        for output in 0..own.interface.outputs.len() {
            let bytes = bytemuck::bytes_of(outputs.get::<Mixed>(output)).to_vec();
            tape[own.first_stream as usize + output].push((index, own.sample_time.instant(index), bytes));
        }
    };
    let mut buffers: Vec<(Inputs, Outputs)> = Vec::new();
    for (number, own) in plan.participants.iter().enumerate() {
        let mut outputs = Outputs::zeroed(&own.interface);
        let t = plan.timebase.seconds(own.sample_time.offset);
        participants[number].initialise(t, &mut outputs).unwrap();
        if own.interface.kind == Kind::Continuous && own.activations > 0 {
            record(&mut tape, number, 0, &outputs);
        }
        buffers.push((Inputs::zeroed(&own.interface), outputs));
    }
    // The value of each input at each activation, before faults.
    let mut input_history: Vec<Vec<Vec<Vec<u8>>>> = plan
        .participants
        .iter()
        .map(|own| vec![Vec::new(); own.inputs.len()])
        .collect();
    let mut remaining = activations(plan);
    while !remaining.is_empty() {
        let (now, number, k) = take_ready(plan, &mut remaining);
        let own = &plan.participants[number];
        let (inputs, outputs) = &mut buffers[number];
        for (input, links) in own.inputs.iter().enumerate() {
            if links.is_empty() {
                continue;
            }
            let received = links.iter().map(|&link| received(plan, &tape, link, now));
            let conversion_kinds = links.iter().map(|&link| {
                let number: usize = plan.links[link].name["link".len()..].parse().unwrap();
                scenario.links[number].6
            });
            let bytes = conversion::assemble_input(conversion_kinds.zip(received));
            input_history[number][input].push(bytes);
            let place = FaultPort::Input {
                participant: number,
                port: input,
            };
            let (history, instant) = (&input_history[number][input], |index| own.sample_time.instant(index));
            let truth = |index: u64| history[index as usize].clone();
            let seen_value = faults::with_faults(plan, place, plan.faults.len(), k, &instant, &truth);
            let seen = plan
                .seen
                .iter()
                .position(|seen| (seen.participant, seen.input) == (number, input));
            if let Some(position) = seen {
                let outputs: usize = plan.participants.iter().map(|own| own.interface.outputs.len()).sum();
                tape[outputs + position].push((k, now, seen_value.clone()));
            }
            *inputs.get_mut::<Mixed>(input) = bytemuck::checked::pod_read_unaligned(&seen_value);
        }
        let step = Step {
            index: k,
            t: plan.timebase.seconds(now),
            t_next: plan.timebase.seconds(own.sample_time.instant(k + 1)),
            period: plan.timebase.seconds(own.sample_time.period),
        };
        participants[number].step(&step, inputs, outputs).unwrap();
        let index = if own.interface.kind == Kind::Sampled { k } else { k + 1 };
        record(&mut tape, number, index, outputs);
    }
    tape
}

/// Instant, participant and number of every activation, in the order of time.
fn activations(plan: &Plan) -> Vec<(Ticks, usize, u64)> {
    let mut all: Vec<(Ticks, usize, u64)> = (0..plan.participants.len())
        .flat_map(|number| (0..plan.participants[number].activations).map(move |k| (number, k)))
        .map(|(number, k)| (plan.participants[number].sample_time.instant(k), number, k))
        .collect();
    all.sort_unstable();
    all
}

/// Takes one of the earliest activations that has everything that it needs.
fn take_ready(plan: &Plan, remaining: &mut Vec<(Ticks, usize, u64)>) -> (Ticks, usize, u64) {
    let now = remaining[0].0;
    let ready = remaining.iter().position(|&(t, number, _)| {
        // A participant that feeds it without delay and is also activated now must come first.
        t == now
            && !plan.links.iter().any(|link| {
                let feeds = link.to.0 == number
                    && plan.participants[link.from.0].interface.kind == Kind::Sampled
                    && link.delivery.delay_bounds().0 == 0;
                feeds
                    && remaining
                        .iter()
                        .any(|&(other_t, other, _)| other_t == now && other == link.from.0)
            })
    });
    remaining.remove(ready.expect("the plan has no algebraic loop"))
}

/// The data received over link number `link` for an activation at `now`: a sample, or the initial value.
fn received(plan: &Plan, tape: &Tape, link: usize, now: Ticks) -> ReceivedSample {
    let link = &plan.links[link];
    let stream = plan.participants[link.from.0].first_stream as usize + link.from.1;
    let arrived = |index: u64, stamp: Ticks| stamp + link.delivery.delay(index) <= now;
    let sent = tape[stream]
        .iter()
        .rev()
        .filter(|(index, stamp, _)| arrived(*index, *stamp));
    let newest = match link.delivery.hold() {
        Hold::Last | Hold::Linear => sent
            .clone()
            .find(|(index, ..)| !link.delivery.is_dropped(*index))
            .map(Some),
        Hold::Initial => sent
            .clone()
            .next()
            .map(|sample| (!link.delivery.is_dropped(sample.0)).then_some(sample)),
    };
    let sent = |index: u64| {
        let producer = &plan.participants[link.from.0];
        let place = FaultPort::Output {
            participant: link.from.0,
            port: link.from.1,
        };
        let recorded = |index: u64| tape[stream][index as usize].2.clone();
        let instant = |index| producer.sample_time.instant(index);
        faults::with_faults(plan, place, plan.faults.len(), index, &instant, &recorded)
    };
    match (newest, &link.initial) {
        (Some(Some((index, ..))), _) if link.delivery.hold() == Hold::Linear => {
            let Some(next) = link.delivery.interpolation_target(*index, now) else {
                return ReceivedSample::Sample(sent(*index));
            };
            let number = |bytes: &[u8]| f64::from_le_bytes(bytes[8..].try_into().unwrap());
            let (before, after) = (sent(*index), sent(next));
            let (a, b) = (number(&before), number(&after));
            let weight = link.delivery.weight(now, *index, next);
            let x = if (b - a).is_finite() {
                a + weight * (b - a)
            } else {
                a * (1.0 - weight) + b * weight
            };
            // A whole number is the earlier one.
            ReceivedSample::Sample([&before[..8], &x.to_le_bytes()].concat())
        }
        (Some(Some((index, ..))), _) => ReceivedSample::Sample(sent(*index)),
        (None, Initial::FirstSample) => ReceivedSample::Sample(sent(0)),
        (_, Initial::Value(bytes)) => ReceivedSample::Initial(bytes.clone()),
        (Some(None), Initial::FirstSample) => ReceivedSample::Initial(vec![0; 16]),
    }
}
