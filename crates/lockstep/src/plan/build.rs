//! Building a plan from the user's specification; every mistake is found before anything starts.

use std::collections::{HashMap, HashSet};

use super::{Initial, Link, PARTICIPANTS_MAX, Participant, Plan, PlanError, capacity, fields, order};
use crate::fault::LinkFault;
use crate::link::{Conversion, DeliveryRule, Timing};
use crate::name::{NAME_MAX, is_name};
use crate::participant::{Interface, Kind};
use crate::port::Descriptor;
use crate::time::{Rational, SampleTime, Timebase};

/// A participant as the user specifies it.
#[derive(Debug, Clone)]
pub struct ParticipantSpec {
    /// The name.
    pub name: String,
    /// The sample period.
    pub period: Rational,
    /// The first activation.
    pub offset: Rational,
    /// The ports.
    pub interface: Interface,
}

/// A connection as the user specifies it.
#[derive(Debug, Clone)]
pub struct LinkSpec {
    /// The name.
    pub name: String,
    /// Participant and output.
    pub from: (String, String),
    /// Participant and input.
    pub to: (String, String),
    /// Delay, jitter, drops.
    pub timing: Timing,
    /// What is read before anything is visible; zeros by default. With a conversion it is a payload of the input, of which only the
    /// fields that the link feeds are used.
    pub initial: Option<Initial>,
    /// The conversion of its samples to fields of the input; without one they are the input, and the two ports have the same description.
    pub conversion: Option<Conversion>,
    /// The name of its random stream besides the name of the input, where the input has several links.
    pub random_stream: Option<String>,
    /// The link faults.
    pub faults: Vec<LinkFault>,
}

impl Plan {
    /// Plans a run of `duration`.
    ///
    /// # Errors
    /// Every mistake that can be diagnosed independently, not only the first.
    pub fn build(
        participants: Vec<ParticipantSpec>,
        links: &[LinkSpec],
        duration: Rational,
        seed: u64,
    ) -> Result<Plan, Vec<PlanError>> {
        let mut errors = check_participants(&participants);
        if !duration.is_positive() {
            errors.push(PlanError::Duration(duration));
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let times = participants.iter().flat_map(|spec| [spec.period, spec.offset]);
        let timebase = Timebase::from_times(times).map_err(|error| vec![error.into()])?;
        let end = timebase.ceil(duration).map_err(|error| vec![error.into()])?;
        let mut plan = Plan {
            timebase,
            end,
            seed,
            participants: Vec::new(),
            links: Vec::new(),
            faults: Vec::new(),
            seen: Vec::new(),
            observed: Vec::new(),
        };
        let mut first_stream = 0;
        for spec in participants {
            let ticks = |time| timebase.ceil(time).map_err(|error| vec![error.into()]);
            let sample_time = SampleTime {
                offset: ticks(spec.offset)?,
                period: ticks(spec.period)?,
            };
            let outputs = spec.interface.outputs.len() as u32;
            plan.participants.push(Participant {
                name: spec.name,
                period: spec.period,
                offset: spec.offset,
                sample_time,
                activations: sample_time.count_before(end),
                rank: 0,
                inputs: vec![Vec::new(); spec.interface.inputs.len()],
                interface: spec.interface,
                first_stream,
            });
            first_stream += outputs;
        }
        let index = NameIndex::of(&plan.participants);
        let (mut names, mut rejected) = (HashSet::new(), HashSet::new());
        for spec in links {
            if !names.insert(spec.name.as_str()) {
                errors.push(PlanError::NameTwice(spec.name.clone()));
            }
            match plan.build_link(spec, &index) {
                Ok(link) => plan.add_link(link, &mut errors),
                Err(error) => {
                    // Its input has a connection, which is the one to be corrected.
                    rejected.extend(index.input(&spec.to));
                    errors.push(error);
                }
            }
        }
        errors.extend(plan.unconnected_inputs(&rejected));
        errors.extend(fields::check_coverage(&plan, &rejected));
        if errors.is_empty() {
            errors = order::rank(&mut plan);
        }
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }

    fn build_link(&self, spec: &LinkSpec, index: &NameIndex) -> Result<Link, PlanError> {
        let participant = |name: &str| {
            index.participants.get(name).copied().ok_or_else(|| PlanError::Unknown {
                link: spec.name.clone(),
                what: "participant".into(),
                name: name.to_owned(),
                known: join_names(self.participants.iter().map(|p| p.name.as_str())),
            })
        };
        let (producer, consumer) = (participant(&spec.from.0)?, participant(&spec.to.0)?);
        let (from, to) = (&self.participants[producer], &self.participants[consumer]);
        let unknown = |direction: &str, name: &str, port: &str, known: Vec<&str>| PlanError::Unknown {
            link: spec.name.clone(),
            what: format!("{direction} of `{name}` called"),
            name: port.to_owned(),
            known: join_names(known),
        };
        let outputs = &from.interface.outputs;
        let output = index.outputs[producer].get(&spec.from.1).copied().ok_or_else(|| {
            unknown(
                "output",
                &from.name,
                &spec.from.1,
                outputs.iter().map(|p| p.name.as_str()).collect(),
            )
        })?;
        let inputs = &to.interface.inputs;
        let input = index.inputs[consumer].get(&spec.to.1).copied().ok_or_else(|| {
            unknown(
                "input",
                &to.name,
                &spec.to.1,
                inputs.iter().map(|p| p.name.as_str()).collect(),
            )
        })?;
        let (sends, takes) = (&outputs[output].descriptor, &inputs[input].descriptor);
        let difference = match &spec.conversion {
            None => sends.difference(takes),
            Some(conversion) if conversion.message != *sends => sends.difference(&conversion.message),
            Some(conversion) => conversion.check(takes).err(),
        };
        if let Some(difference) = difference {
            return Err(PlanError::Mismatch {
                link: spec.name.clone(),
                from: format!("{}.{}", spec.from.0, spec.from.1),
                to: format!("{}.{}", spec.to.0, spec.to.1),
                difference,
            });
        }
        let initial = initial_value(spec, from, to, takes.size as usize)?;
        // An input with one source names the random stream: the draws stay the same when a connection is renamed or gets more consumers.
        let random_stream = match &spec.random_stream {
            None => format!("{}.{}", spec.to.0, spec.to.1),
            Some(own) => format!("{}.{}.{own}", spec.to.0, spec.to.1),
        };
        let delivery = DeliveryRule::new(
            &spec.timing,
            &spec.faults,
            from.sample_time,
            &self.timebase,
            self.seed,
            &random_stream,
        )
        .map_err(|source| PlanError::Timing {
            link: spec.name.clone(),
            source,
        })?;
        let capacity = capacity::capacity(&spec.name, (&spec.timing, &spec.faults), &delivery, to.sample_time)?;
        Ok(Link {
            name: spec.name.clone(),
            from: (producer, output),
            to: (consumer, input),
            timing: spec.timing,
            faults: spec.faults.clone(),
            delivery,
            initial,
            conversion: spec.conversion.clone(),
            capacity,
        })
    }

    fn add_link(&mut self, link: Link, errors: &mut Vec<PlanError>) {
        // A link without a conversion must be the only one of its input, so the first link of an input shows whether the input is fed as
        // a whole.
        let first = self.participants[link.to.0].inputs[link.to.1].first();
        let whole = |link: &Link| link.conversion.is_none();
        let first = first.map(|&first| &self.links[first]);
        match first.filter(|first| whole(first) || whole(&link)) {
            Some(first) => errors.push(PlanError::FedTwice {
                input: self.input_name(link.to),
                first: first.name.clone(),
                second: link.name,
            }),
            None => {
                let number = self.links.len();
                self.participants[link.to.0].inputs[link.to.1].push(number);
                self.links.push(link);
            }
        }
    }

    /// The inputs that need a connection and have none, not even a `rejected` one.
    fn unconnected_inputs(&self, rejected: &HashSet<(usize, usize)>) -> Vec<PlanError> {
        let mut errors = Vec::new();
        let mut outputs = None;
        for (number, participant) in self.participants.iter().enumerate() {
            for (input, port) in participant.interface.inputs.iter().enumerate() {
                if port.required && participant.inputs[input].is_empty() && !rejected.contains(&(number, input)) {
                    let outputs = outputs.get_or_insert_with(|| self.outputs_by_payload());
                    errors.push(PlanError::NotConnected {
                        input: self.input_name((number, input)),
                        message: port.descriptor.name.clone(),
                        candidates: outputs.get(&port.descriptor).cloned().unwrap_or_default(),
                    });
                }
            }
        }
        errors
    }

    /// The names of the outputs with each payload, limited to the first few.
    fn outputs_by_payload(&self) -> HashMap<&Descriptor, Vec<String>> {
        let mut outputs: HashMap<&Descriptor, Vec<String>> = HashMap::new();
        for (number, participant) in self.participants.iter().enumerate() {
            for (output, port) in participant.interface.outputs.iter().enumerate() {
                let names = outputs.entry(&port.descriptor).or_default();
                if names.len() < SHOWN_MAX {
                    names.push(self.output_name((number, output)));
                }
            }
        }
        outputs
    }
}

/// The most names of matching outputs in an error message.
const SHOWN_MAX: usize = 24;

/// The initial value of the link from `from` to `to`, for payloads of `size` bytes.
fn initial_value(spec: &LinkSpec, from: &Participant, to: &Participant, size: usize) -> Result<Initial, PlanError> {
    let initial = spec.initial.clone().unwrap_or_else(|| Initial::zero(size));
    match &initial {
        Initial::Value(bytes) if !initial.fits(size) => {
            return Err(PlanError::InitialSize {
                link: spec.name.clone(),
                given: bytes.len(),
                needed: size,
            });
        }
        Initial::FirstSample => {
            let from_name = format!("{}.{}", spec.from.0, spec.from.1);
            if from.interface.kind == Kind::Sampled {
                return Err(PlanError::FirstSample {
                    link: spec.name.clone(),
                    from: from_name,
                });
            }
            if from.sample_time.offset > to.sample_time.offset {
                return Err(PlanError::FirstSampleLate {
                    link: spec.name.clone(),
                    from: from_name,
                    starts: from.offset,
                    reads: to.offset,
                });
            }
        }
        Initial::Value(_) => {}
    }
    Ok(initial)
}

fn join_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names = names.into_iter();
    let shown: Vec<String> = names.by_ref().take(SHOWN_MAX).map(|name| format!("`{name}`")).collect();
    match (shown.is_empty(), names.count()) {
        (true, _) => "none".into(),
        (false, 0) => shown.join(", "),
        (false, more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// The numbers of participants and ports by name, so that a link needs no search.
struct NameIndex {
    participants: HashMap<String, usize>,
    inputs: Vec<HashMap<String, usize>>,
    outputs: Vec<HashMap<String, usize>>,
}

impl NameIndex {
    fn of(participants: &[Participant]) -> NameIndex {
        fn numbers<'a>(names: impl Iterator<Item = &'a String>) -> HashMap<String, usize> {
            names.enumerate().map(|(number, name)| (name.clone(), number)).collect()
        }
        let interfaces = || participants.iter().map(|participant| &participant.interface);
        NameIndex {
            participants: numbers(participants.iter().map(|participant| &participant.name)),
            inputs: interfaces()
                .map(|interface| numbers(interface.inputs.iter().map(|port| &port.name)))
                .collect(),
            outputs: interfaces()
                .map(|interface| numbers(interface.outputs.iter().map(|port| &port.name)))
                .collect(),
        }
    }
}

impl NameIndex {
    /// The numbers of the participant and the input with these names.
    fn input(&self, (participant, input): &(String, String)) -> Option<(usize, usize)> {
        let participant = *self.participants.get(participant)?;
        Some((participant, *self.inputs[participant].get(input)?))
    }
}

fn check_participants(specs: &[ParticipantSpec]) -> Vec<PlanError> {
    let mut errors = Vec::new();
    if specs.is_empty() {
        errors.push(PlanError::Empty);
    }
    if specs.len() > PARTICIPANTS_MAX {
        errors.push(PlanError::TooMany(specs.len()));
    }
    let mut names = HashSet::new();
    for spec in specs {
        let starts_with_letter = spec.name.starts_with(|c: char| c.is_ascii_alphabetic());
        if !starts_with_letter || !is_name(&spec.name, NAME_MAX) {
            errors.push(PlanError::Name(spec.name.clone()));
        }
        if !names.insert(spec.name.as_str()) {
            errors.push(PlanError::NameTwice(spec.name.clone()));
        }
        if !spec.period.is_positive() {
            errors.push(PlanError::Period {
                participant: spec.name.clone(),
                period: spec.period,
            });
        }
        if spec.offset.is_negative() {
            errors.push(PlanError::Offset {
                participant: spec.name.clone(),
                offset: spec.offset,
            });
        }
        if let Err(source) = spec.interface.validate() {
            errors.push(PlanError::Interface {
                participant: spec.name.clone(),
                source,
            });
        }
    }
    errors
}
