//! Planning: from a scenario and the ports of its participants to a plan.

use std::collections::HashMap;

use lockstep::link::{Conversion, TimingError};
use lockstep::participant::{Input, Interface, Kind, Output};
use lockstep::plan::{DelayPart, Initial, LinkSpec, ParticipantSpec, Plan, PlanError};
use lockstep::port::{Descriptor, Element, Field};

use super::error::{Mistake, ScenarioError};
use super::fields;
use super::ports::{ConnectionEnd, not_a_port};
use super::resolve::Scenario;
use super::spec::ConnectionSpec;

impl Scenario {
    /// A plan for inspection, without running anything: the ports of external participants are assumed to match the ports that they
    /// are connected to, and to be continuous, so that no loop is reported that may not exist.
    pub fn assumed_plan(&self, known: &[Option<Interface>]) -> Result<Plan, ScenarioError> {
        let mut assumed: Vec<Interface> = known
            .iter()
            .map(|interface| interface.clone().unwrap_or_else(|| Interface::new(Kind::Continuous)))
            .collect();
        let mut ports: Vec<PortNumbers> = assumed.iter().map(PortNumbers::of).collect();
        // Ports whose connection names fields need not match: they are assumed last, and with an unknown payload.
        let (by_field, by_port): (Vec<_>, Vec<_>) =
            (self.spec.connections.values()).partition(|connection| fields::names_fields(connection));
        for (connection, same_ports) in by_port
            .iter()
            .map(|one| (one, true))
            .chain(by_field.iter().map(|one| (one, false)))
        {
            let end = |text: &str| {
                let end = ConnectionEnd::of(text)?;
                Some((self.names.number(end.participant)?, end.port.to_owned()))
            };
            let Some((from, output)) = end(&connection.from) else {
                continue;
            };
            for to in &connection.to {
                let Some((to, input)) = end(to) else { continue };
                let output_descriptor = ports[from].outputs.get(&output);
                let output_descriptor = output_descriptor.map(|&port| assumed[from].outputs[port].descriptor.clone());
                let input_descriptor = ports[to].inputs.get(&input);
                let input_descriptor = input_descriptor.map(|&port| assumed[to].inputs[port].descriptor.clone());
                let (has_output, has_input) = (output_descriptor.is_some(), input_descriptor.is_some());
                let descriptor = output_descriptor
                    .or(input_descriptor)
                    .filter(|_| same_ports)
                    .unwrap_or_else(unknown_payload);
                if known[from].is_none() && !has_output {
                    ports[from].outputs.insert(output.clone(), assumed[from].outputs.len());
                    assumed[from].outputs.push(Output {
                        name: output.clone(),
                        descriptor: descriptor.clone(),
                    });
                }
                if known[to].is_none() && !has_input {
                    ports[to].inputs.insert(input.clone(), assumed[to].inputs.len());
                    assumed[to].inputs.push(Input {
                        name: input,
                        descriptor,
                        required: same_ports,
                    });
                }
            }
        }
        self.plan_for(&assumed, |participant| known[participant].is_some())
    }

    /// The plan, given the ports of all participants.
    pub fn plan(&self, interfaces: &[Interface]) -> Result<Plan, ScenarioError> {
        self.plan_for(interfaces, |_| true)
    }

    /// Fields and initial values are resolved against the ports of those participants that are `certain`.
    fn plan_for(&self, interfaces: &[Interface], certain: impl Fn(usize) -> bool) -> Result<Plan, ScenarioError> {
        let mut mistakes = Vec::new();
        let mut links = Vec::new();
        // The connection that each link comes from.
        let mut origins: HashMap<String, &str> = HashMap::new();
        let ports: Vec<PortNumbers> = interfaces.iter().map(PortNumbers::of).collect();
        let planner = Planner {
            scenario: self,
            interfaces,
            ports: &ports,
            certain: &certain,
        };
        for (name, connection) in &self.spec.connections {
            match planner.links(name, connection) {
                Ok(own) => {
                    for link in own {
                        origins.entry(link.name.clone()).or_insert(name);
                        links.push(link);
                    }
                }
                Err(wrong) => mistakes.extend(wrong),
            }
        }
        let interfaces = self.with_open_inputs(interfaces, &links, &certain, &mut mistakes);
        if !mistakes.is_empty() {
            return Err(self.source.error(mistakes));
        }
        let specs = self
            .participants
            .iter()
            .zip(&interfaces)
            .map(|(entry, interface)| ParticipantSpec {
                name: entry.setup.name.clone(),
                period: entry.period,
                offset: entry.offset,
                interface: interface.clone(),
            });
        let refuse = |errors: Vec<PlanError>| {
            let mistakes = errors
                .iter()
                .map(|error| self.source.mistake(&key_of_error(error, &origins), error.to_string()));
            self.source.error(mistakes.collect())
        };
        let mut plan = Plan::build(specs.collect(), &links, self.duration, self.seed).map_err(refuse)?;
        let faults = self.faults.signals(&self.source, &plan, certain);
        plan.add_signal_faults(faults.map_err(|mistakes| self.source.error(mistakes))?)
            .map_err(refuse)?;
        Ok(plan)
    }

    /// `interfaces`, in which the inputs that a program sets need no connection; such inputs that have a connection, or do not
    /// exist, are mistakes.
    fn with_open_inputs(
        &self,
        interfaces: &[Interface],
        links: &[LinkSpec],
        certain: impl Fn(usize) -> bool,
        mistakes: &mut Vec<Mistake>,
    ) -> Vec<Interface> {
        let mut interfaces = interfaces.to_vec();
        if self.inputs.is_empty() {
            return interfaces;
        }
        let mut feeds: HashMap<(&str, &str), &str> = HashMap::new();
        for link in links {
            let (participant, input) = &link.to;
            feeds.entry((participant, input)).or_insert(&link.name);
        }
        for (participant, name) in self.inputs.iter().filter(|(participant, _)| certain(*participant)) {
            let port = format!("{}.{name}", self.participants[*participant].setup.name);
            let fed = feeds.get(&(self.participants[*participant].setup.name.as_str(), name.as_str()));
            let inputs = &mut interfaces[*participant].inputs;
            let reason = match (inputs.iter_mut().find(|input| input.name == *name), fed) {
                (Some(input), None) => {
                    input.required = false;
                    continue;
                }
                (Some(_), Some(link)) => {
                    format!("the connection `{link}` feeds `{port}`: leave one of them out")
                }
                (None, _) => {
                    let known: Vec<String> = inputs.iter().map(|input| format!("`{}`", input.name)).collect();
                    format!("there is no input `{port}`; there is {}", known.join(", "))
                }
            };
            mistakes.push(self.source.mistake("inputs", reason));
        }
        interfaces
    }
}

/// The key to which a plan's error belongs; `origins` has the connection of each link.
fn key_of_error(error: &PlanError, origins: &HashMap<String, &str>) -> String {
    let connection = |link: &str| {
        let origin = origins.get(link);
        origin.map_or("connections".to_owned(), |name| format!("connections.{name}"))
    };
    match error {
        PlanError::Period { participant, .. } => format!("participants.{participant}.period"),
        PlanError::Offset { participant, .. } => format!("participants.{participant}.offset"),
        PlanError::Interface { participant, .. } => format!("participants.{participant}"),
        PlanError::Name(name) | PlanError::NameTwice(name) => format!("participants.{name}"),
        PlanError::Duration(_) => "duration".into(),
        PlanError::Timing { link, source } => match source {
            TimingError::Negative { what, .. } => format!("{}.{what}", connection(link)),
            TimingError::Probability(_) => format!("{}.drop", connection(link)),
            TimingError::Precision { .. } => connection(link),
            TimingError::Fault { fault, .. } => format!("faults.{fault}"),
        },
        PlanError::Capacity { link, longest, .. } => match longest {
            DelayPart::Delay(_) => format!("{}.delay", connection(link)),
            DelayPart::Jitter(_) => format!("{}.jitter", connection(link)),
            DelayPart::Fault { name, .. } => format!("faults.{name}.extra-delay"),
        },
        PlanError::InitialSize { link, .. }
        | PlanError::FirstSample { link, .. }
        | PlanError::FirstSampleLate { link, .. } => format!("{}.initial", connection(link)),
        PlanError::Unknown { link, .. } | PlanError::Mismatch { link, .. } => connection(link),
        PlanError::FedTwice { second, .. } | PlanError::FieldFedTwice { second, .. } => connection(second),
        PlanError::Fault { fault, .. } => format!("faults.{fault}"),
        PlanError::NotConnected { .. }
        | PlanError::FieldsNotFed { .. }
        | PlanError::AlgebraicLoop { .. }
        | PlanError::TooManyCycles => "connections".into(),
        PlanError::Empty | PlanError::TooMany(_) | PlanError::Ticks(_) => "participants".into(),
    }
}

/// Converts connections into links.
struct Planner<'a, C> {
    scenario: &'a Scenario,
    interfaces: &'a [Interface],
    ports: &'a [PortNumbers],
    certain: &'a C,
}

impl<C: Fn(usize) -> bool> Planner<'_, C> {
    /// The links of connection `name`.
    fn links(&self, name: &str, connection: &ConnectionSpec) -> Result<Vec<LinkSpec>, Vec<Mistake>> {
        let mistake = |key: &str, reason: String| {
            self.scenario
                .source
                .mistake(&format!("connections.{name}.{key}"), reason)
        };
        let Some(from) = ConnectionEnd::of(&connection.from) else {
            return Err(vec![mistake("from", not_a_port(&connection.from))]);
        };
        let all = &connection.to;
        if all.is_empty() {
            let reason = "names no input: write \"PARTICIPANT.INPUT\"";
            return Err(vec![mistake("to", reason.into())]);
        }
        let (mut links, mut mistakes) = (Vec::new(), Vec::new());
        for to in all {
            let Some(end) = ConnectionEnd::of(to) else {
                mistakes.push(mistake("to", not_a_port(to)));
                continue;
            };
            let link = if all.len() == 1 {
                name.to_owned()
            } else {
                format!("{name}-{}-{}", end.participant, end.port)
            };
            match self.link(connection, from, end) {
                Ok((conversion, initial)) => links.push(LinkSpec {
                    name: link,
                    from: from.owned(),
                    to: end.owned(),
                    timing: connection.timing(),
                    initial,
                    random_stream: conversion.is_some().then(|| name.to_owned()),
                    conversion,
                    faults: self.scenario.faults.of_connection(name),
                }),
                // A mistake in the output occurs for each input, and is reported once.
                Err((key, reason)) => {
                    let wrong = mistake(key, reason);
                    if !mistakes.contains(&wrong) {
                        mistakes.push(wrong);
                    }
                }
            }
        }
        if mistakes.is_empty() { Ok(links) } else { Err(mistakes) }
    }

    /// The conversion of samples on the way from `from` to `to`, and the start value.
    fn link(
        &self,
        connection: &ConnectionSpec,
        from: ConnectionEnd<'_>,
        to: ConnectionEnd<'_>,
    ) -> Result<(Option<Conversion>, Option<Initial>), fields::Refusal> {
        let output = self.port(
            from,
            |ports| &ports.outputs,
            |interface, port| &interface.outputs[port].descriptor,
        );
        let input = self.port(
            to,
            |ports| &ports.inputs,
            |interface, port| &interface.inputs[port].descriptor,
        );
        let certain = |found: Option<(usize, _)>| found.filter(|&(participant, _)| (self.certain)(participant));
        let ends = fields::LinkEnds {
            output: certain(output).map(|(_, descriptor)| descriptor),
            input: certain(input).map(|(_, descriptor)| descriptor),
            programs: [output, input].map(|found| Some(&self.scenario.participants[found?.0].program)),
        };
        let Some((_, assumed)) = output else {
            return Ok((None, None));
        };
        let conversion = fields::conversion(connection, from, to, &ends, assumed)?;
        let shown = match conversion {
            Some(_) => ends.input,
            None => ends.output,
        };
        let initial = shown.map(|shown| {
            let initial = fields::initial(&connection.initial, to, &ends)?;
            let initial = super::initial::initial(&initial, shown)?;
            match &conversion {
                Some(conversion) => fields::check_initial(&initial, conversion, shown).map(|()| initial),
                None => Ok(initial),
            }
        });
        Ok((conversion, initial.transpose().map_err(|reason| ("initial", reason))?))
    }

    /// The participant at `end` and the descriptor of its port, if both exist.
    fn port<'a>(
        &'a self,
        end: ConnectionEnd<'_>,
        numbers: impl Fn(&PortNumbers) -> &HashMap<String, usize>,
        descriptor: impl Fn(&'a Interface, usize) -> &'a Descriptor,
    ) -> Option<(usize, &'a Descriptor)> {
        let participant = self.scenario.names.number(end.participant)?;
        let port = *numbers(&self.ports[participant]).get(end.port)?;
        Some((participant, descriptor(&self.interfaces[participant], port)))
    }
}

/// The numbers of a participant's ports by their names.
struct PortNumbers {
    inputs: HashMap<String, usize>,
    outputs: HashMap<String, usize>,
}

impl PortNumbers {
    fn of(interface: &Interface) -> PortNumbers {
        let inputs = interface.inputs.iter().enumerate();
        let outputs = interface.outputs.iter().enumerate();
        PortNumbers {
            inputs: inputs.map(|(number, port)| (port.name.clone(), number)).collect(),
            outputs: outputs.map(|(number, port)| (port.name.clone(), number)).collect(),
        }
    }
}

/// A placeholder for a payload without a descriptor.
fn unknown_payload() -> Descriptor {
    let byte = Field {
        name: "unknown".into(),
        element: Element::U8,
        shape: Vec::new(),
        unit: "1".into(),
        frame: String::new(),
        offset: 0,
        values: Vec::new(),
    };
    Descriptor {
        name: "unknown".into(),
        size: 1,
        fields: vec![byte],
    }
}
