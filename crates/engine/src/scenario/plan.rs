//! From a scenario and the ports of its participants to a plan.

use std::collections::HashMap;

use lockstep::link::Timing;
use lockstep::participant::{Input, Interface, Kind, Output};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan, PlanError};
use lockstep::port::{Descriptor, Element, Field};

use super::error::{Mistake, ScenarioError};
use super::resolve::Scenario;

impl Scenario {
    /// A plan for looking at, without running anything: the ports of external participants are taken to be what they are
    /// connected to, and continuous, so that no loop is reported that may not be there.
    pub fn sketch(&self, known: &[Option<Interface>]) -> Result<Plan, ScenarioError> {
        let mut assumed: Vec<Interface> = known
            .iter()
            .map(|interface| interface.clone().unwrap_or_else(|| Interface::new(Kind::Continuous)))
            .collect();
        let mut ports: Vec<Ports> = assumed.iter().map(Ports::of).collect();
        for (_, connection) in &self.connections {
            let end = |text: &str| {
                let (participant, name) = port(text)?;
                Some((self.names.number(&participant)?, name))
            };
            let Some((from, output)) = end(&connection.from) else {
                continue;
            };
            for to in connection.to.all() {
                let Some((to, input)) = end(to) else { continue };
                let given = ports[from].outputs.get(&output);
                let given = given.map(|&port| assumed[from].outputs[port].descriptor.clone());
                let taken = ports[to].inputs.get(&input);
                let taken = taken.map(|&port| assumed[to].inputs[port].descriptor.clone());
                let (gives, takes) = (given.is_some(), taken.is_some());
                let descriptor = given.or(taken).unwrap_or_else(unknown_payload);
                if known[from].is_none() && !gives {
                    ports[from].outputs.insert(output.clone(), assumed[from].outputs.len());
                    assumed[from].outputs.push(Output {
                        name: output.clone(),
                        descriptor: descriptor.clone(),
                    });
                }
                if known[to].is_none() && !takes {
                    ports[to].inputs.insert(input.clone(), assumed[to].inputs.len());
                    assumed[to].inputs.push(Input {
                        name: input,
                        descriptor,
                        required: true,
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

    /// Initial values are read against the ports of those participants that are `certain`.
    fn plan_for(&self, interfaces: &[Interface], certain: impl Fn(usize) -> bool) -> Result<Plan, ScenarioError> {
        let mut mistakes = Vec::new();
        let mut links = Vec::new();
        // The connection of each link.
        let mut origins: HashMap<String, &str> = HashMap::new();
        let outputs: Vec<Ports> = interfaces.iter().map(Ports::of).collect();
        for (name, connection) in &self.connections {
            let key = |field: &str| format!("connections.{name}.{field}");
            let Some(from) = port(&connection.from) else {
                mistakes.push(self.source.mistake(&key("from"), not_a_port(&connection.from)));
                continue;
            };
            let all = connection.to.all();
            if all.is_empty() {
                mistakes.push(
                    self.source
                        .mistake(&key("to"), "names no input: write \"PARTICIPANT.INPUT\""),
                );
            }
            let giver = self.names.number(&from.0).filter(|&giver| certain(giver));
            let output = giver.and_then(|giver| {
                let port = outputs[giver].outputs.get(&from.1)?;
                interfaces[giver].outputs.get(*port)
            });
            let initial = match output.map(|port| super::initial::initial(&connection.initial, &port.descriptor)) {
                Some(Err(reason)) => {
                    mistakes.push(self.source.mistake(&key("initial"), reason));
                    continue;
                }
                Some(Ok(initial)) => Some(initial),
                None => None,
            };
            for to in all {
                let Some(to_port) = port(to) else {
                    mistakes.push(self.source.mistake(&key("to"), not_a_port(to)));
                    continue;
                };
                let link = if all.len() == 1 {
                    name.clone()
                } else {
                    format!("{name}-{}-{}", to_port.0, to_port.1)
                };
                let timing: Timing = connection.timing();
                origins.entry(link.clone()).or_insert(name);
                links.push(LinkSpec {
                    name: link,
                    from: from.clone(),
                    to: to_port,
                    timing,
                    initial: initial.clone(),
                    faults: self.faults.of_connection(name),
                });
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
                .map(|error| self.source.mistake(&place(error, &origins), error.to_string()));
            self.source.error(mistakes.collect())
        };
        let mut plan = Plan::build(specs.collect(), &links, self.duration, self.seed).map_err(refuse)?;
        let faults = self.faults.signals(&self.source, &plan, certain);
        plan.disturb(faults.map_err(|mistakes| self.source.error(mistakes))?)
            .map_err(refuse)?;
        Ok(plan)
    }

    /// `interfaces` with the inputs that a program sets needing no connection; those that have one, or do not exist, are mistakes.
    fn with_open_inputs(
        &self,
        interfaces: &[Interface],
        links: &[LinkSpec],
        certain: impl Fn(usize) -> bool,
        mistakes: &mut Vec<Mistake>,
    ) -> Vec<Interface> {
        let mut interfaces = interfaces.to_vec();
        for (participant, name) in self.inputs.iter().filter(|(participant, _)| certain(*participant)) {
            let port = format!("{}.{name}", self.participants[*participant].setup.name);
            let fed = links
                .iter()
                .find(|link| link.to == (self.participants[*participant].setup.name.clone(), name.clone()));
            let inputs = &mut interfaces[*participant].inputs;
            let reason = match (inputs.iter_mut().find(|input| input.name == *name), fed) {
                (Some(input), None) => {
                    input.required = false;
                    continue;
                }
                (Some(_), Some(link)) => {
                    format!("the connection `{}` feeds `{port}`: leave one of them out", link.name)
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

/// The key that a plan's error is about, with the connection of each link.
fn place(error: &PlanError, origins: &HashMap<String, &str>) -> String {
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
        PlanError::Unknown { link, .. }
        | PlanError::Mismatch { link, .. }
        | PlanError::Timing { link, .. }
        | PlanError::InitialSize { link, .. }
        | PlanError::FirstSample { link, .. }
        | PlanError::FirstSampleLate { link, .. }
        | PlanError::Capacity { link, .. } => connection(link),
        PlanError::FedTwice { second, .. } => connection(second),
        PlanError::Fault { fault, .. } => format!("faults.{fault}"),
        PlanError::NotConnected { .. } | PlanError::AlgebraicLoop { .. } | PlanError::TooManyCircles => {
            "connections".into()
        }
        PlanError::Empty | PlanError::TooMany(_) | PlanError::Ticks(_) => "participants".into(),
    }
}

/// The numbers of a participant's ports by their names.
struct Ports {
    inputs: HashMap<String, usize>,
    outputs: HashMap<String, usize>,
}

impl Ports {
    fn of(interface: &Interface) -> Ports {
        let inputs = interface.inputs.iter().enumerate();
        let outputs = interface.outputs.iter().enumerate();
        Ports {
            inputs: inputs.map(|(number, port)| (port.name.clone(), number)).collect(),
            outputs: outputs.map(|(number, port)| (port.name.clone(), number)).collect(),
        }
    }
}

/// Stands for a payload without a descriptor.
fn unknown_payload() -> Descriptor {
    let byte = Field {
        name: "unknown".into(),
        element: Element::U8,
        shape: Vec::new(),
        unit: "1".into(),
        frame: String::new(),
        offset: 0,
    };
    Descriptor {
        name: "unknown".into(),
        size: 1,
        fields: vec![byte],
    }
}

pub(super) fn port(text: &str) -> Option<(String, String)> {
    let (participant, port) = text.split_once('.')?;
    (!participant.is_empty() && !port.is_empty()).then(|| (participant.to_owned(), port.to_owned()))
}

pub(super) fn not_a_port(text: &str) -> String {
    format!("`{text}` is not a port: write \"PARTICIPANT.PORT\"")
}
