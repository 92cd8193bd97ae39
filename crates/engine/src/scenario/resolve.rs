//! From a scenario file to participants and a plan.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lockstep::link::Timing;
use lockstep::participant::{Input, Interface, Kind, Output, Participant, Setup};
use lockstep::plan::{LinkSpec, ParticipantSpec, Plan, PlanError};
use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::Rational;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::error::{Mistake, ScenarioError};
use super::failure::{Named, OnFailure, OnFailureEntry};
use super::faults::{self, Faults, Substitution};
use super::guards::{self, Guard};
use super::program::{Program, program};
use super::source::Source;
use super::types::{ConnectionEntry, ParticipantEntry, Top};
use crate::Catalogue;

/// A participant of a scenario.
#[derive(Debug, Clone)]
pub struct Entry {
    /// What runs.
    pub program: Program,
    /// The sample period.
    pub period: Rational,
    /// The first activation.
    pub offset: Rational,
    /// What it is told about itself.
    pub setup: Setup,
    /// What happens when it fails.
    pub on_failure: OnFailure,
    /// How long its program may take to enter the run and to answer a request, where the scenario says so.
    pub start_within: Option<Rational>,
    /// Whether the program is there because another one failed.
    pub replaced: bool,
}

/// A scenario that has been read and understood, as far as that goes without the participants.
pub struct Scenario {
    /// The file's name without its ending.
    pub name: String,
    /// The one-line description.
    pub title: String,
    /// How long the run is.
    pub duration: Rational,
    /// The seed of every random stream.
    pub seed: u64,
    /// The participants in the order of their names.
    pub participants: Vec<Entry>,
    /// The table `assessment`, if there is one.
    pub assessment: Option<Table>,
    /// Who takes over in mid-run, in the order of time.
    pub substitutions: Vec<Substitution>,
    connections: Vec<(String, ConnectionEntry)>,
    faults: Faults,
    pub(super) guards: Vec<Guard>,
    pub(super) source: Source,
}

impl Scenario {
    /// Reads `file` and applies `overrides`, each `key.path=value` or `faults+=key=value,…`.
    pub fn read(catalogue: &Arc<Catalogue>, file: &Path, overrides: &[String]) -> Result<Scenario, ScenarioError> {
        Scenario::read_with(catalogue, file, overrides, |_| {})
    }

    /// Reads `file`, applies `overrides`, and lets `change` make something else of the whole before it is understood.
    pub fn read_with(
        catalogue: &Arc<Catalogue>,
        file: &Path,
        overrides: &[String],
        change: impl FnOnce(&mut Table),
    ) -> Result<Scenario, ScenarioError> {
        let mut source = Source::read(catalogue, file, overrides)?;
        change(&mut source.table);
        Scenario::of(file, source)
    }

    /// What `file` would say if `text` stood in it.
    pub fn read_text(catalogue: &Arc<Catalogue>, file: &Path, text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::of(file, Source::of_text(catalogue, file, text.to_owned(), &[])?)
    }

    fn of(file: &Path, source: Source) -> Result<Scenario, ScenarioError> {
        let top: Top =
            typed(&source, "", Value::Table(source.table.clone())).map_err(|mistake| source.error(vec![mistake]))?;
        let mut mistakes = Vec::new();
        let folder = source.folder().to_owned();
        let mut participants = Vec::new();
        let names: Vec<String> = top.participants.keys().cloned().collect();
        for (name, value) in top.participants {
            let key = format!("participants.{name}");
            let read = typed::<ParticipantEntry>(&source, &key, value);
            match read.and_then(|entry| resolve(&source, &folder, &name, entry, top.seed)) {
                Ok(entry) => participants.push(entry),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        let faults = faults::read(&source, &folder, &names, &top.connections, top.faults);
        let (faults, substitutions) = faults.unwrap_or_else(|wrong| {
            mistakes.extend(wrong);
            Default::default()
        });
        let guards = guards::read(&source, &names, top.guards).unwrap_or_else(|wrong| {
            mistakes.extend(wrong);
            Vec::new()
        });
        let mut connections = Vec::new();
        for (name, value) in top.connections {
            match typed::<ConnectionEntry>(&source, &format!("connections.{name}"), value) {
                Ok(entry) => connections.push((name, entry)),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        if !mistakes.is_empty() {
            return Err(source.error(mistakes));
        }
        let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("run");
        Ok(Scenario {
            name: stem.to_owned(),
            title: top.title,
            duration: top.duration,
            seed: top.seed,
            participants,
            connections,
            assessment: top.assessment,
            substitutions,
            faults,
            guards,
            source,
        })
    }

    /// What its participants and its assessment are made of.
    pub fn catalogue(&self) -> &Arc<Catalogue> {
        &self.source.catalogue
    }

    /// The files that the scenario names and whose contents it now holds.
    pub fn files(&self) -> &[PathBuf] {
        &self.source.files
    }

    /// The scenario with files and overrides filled in, as TOML.
    pub fn resolved(&self) -> &Table {
        &self.source.table
    }

    /// The same with programs named in full: it can be run from anywhere.
    pub fn portable(&self) -> Table {
        let mut table = self.source.table.clone();
        let in_full = |run: Option<&mut Value>| {
            if let Some(Value::String(exe)) = run.and_then(|run| run.get_mut("exe"))
                && exe.contains('/')
                && let Ok(path) = std::path::absolute(self.source.folder().join(exe.as_str()))
            {
                *exe = path.to_string_lossy().into_owned();
            }
        };
        let participants = table.get_mut("participants").and_then(Value::as_table_mut);
        for (_, entry) in participants.into_iter().flatten() {
            in_full(entry.get_mut("run"));
            in_full(
                entry
                    .get_mut("on-failure")
                    .and_then(|policy| policy.get_mut("substitute")),
            );
        }
        let faults = table.get_mut("faults").and_then(Value::as_array_mut);
        for fault in faults.into_iter().flatten() {
            in_full(fault.get_mut("run"));
        }
        table
    }

    /// Makes every participant that this program contains; `None` for the others.
    pub fn make(&self) -> Result<Vec<Option<Box<dyn Participant>>>, ScenarioError> {
        let (mut made, mut mistakes) = (Vec::new(), Vec::new());
        for entry in &self.participants {
            let factory = match &entry.program {
                Program::Builtin(name) => self.catalogue().factory(name),
                Program::External { .. } => None,
            };
            match factory.map(|factory| factory(&entry.setup)).transpose() {
                Ok(participant) => made.push(participant),
                Err(error) => mistakes.push(self.parameter(&entry.setup.name, &error.key, &error.reason)),
            }
        }
        if mistakes.is_empty() {
            Ok(made)
        } else {
            Err(self.source.error(mistakes))
        }
    }

    /// A refusal of a parameter, with its place in the file.
    pub fn refusal(&self, participant: &str, key: &str, reason: &str) -> ScenarioError {
        self.source.error(vec![self.parameter(participant, key, reason)])
    }

    /// A refusal of the program in a participant's place.
    pub fn program_refusal(&self, participant: &str, reason: &str) -> ScenarioError {
        let key = format!("participants.{participant}.run");
        self.source.error(vec![self.source.mistake(&key, reason)])
    }

    /// A refusal of a substitution, with its place in the file.
    pub fn substitution_refusal(&self, substitution: &Substitution, reason: &str) -> ScenarioError {
        self.source.error(vec![self.source.mistake(&substitution.key, reason)])
    }

    /// A refusal of what takes over from a participant that fails.
    pub fn policy_refusal(&self, participant: &str, reason: &str) -> ScenarioError {
        let key = format!("participants.{participant}.on-failure");
        self.source.error(vec![self.source.mistake(&key, reason)])
    }

    /// A mistake in the table `assessment`.
    pub fn assessment_refusal(&self, key: &str, reason: &str) -> ScenarioError {
        let key = if key.is_empty() {
            "assessment".to_owned()
        } else {
            format!("assessment.{key}")
        };
        self.source.error(vec![self.source.mistake(&key, reason)])
    }

    fn parameter(&self, participant: &str, key: &str, reason: &str) -> Mistake {
        let place = format!("participants.{participant}.parameters");
        let key = if key.is_empty() {
            place
        } else {
            format!("{place}.{key}")
        };
        self.source.mistake(&key, reason)
    }

    /// A plan for looking at, without running anything: the ports of external participants are taken to be what they are
    /// connected to, and continuous, so that no loop is reported that may not be there.
    pub fn sketch(&self, known: &[Option<Interface>]) -> Result<Plan, ScenarioError> {
        let mut assumed: Vec<Interface> = known
            .iter()
            .map(|interface| interface.clone().unwrap_or_else(|| Interface::new(Kind::Continuous)))
            .collect();
        let number = |name: &str| self.participants.iter().position(|entry| entry.setup.name == name);
        for (_, connection) in &self.connections {
            let Some((giver, output)) = connection.from.split_once('.') else {
                continue;
            };
            let Some(from) = number(giver) else { continue };
            for to in connection.to.all() {
                let Some((taker, input)) = to.split_once('.') else {
                    continue;
                };
                let Some(to) = number(taker) else { continue };
                let given = assumed[from]
                    .outputs
                    .iter()
                    .find(|port| port.name == output)
                    .map(|port| port.descriptor.clone());
                let taken = assumed[to]
                    .inputs
                    .iter()
                    .find(|port| port.name == input)
                    .map(|port| port.descriptor.clone());
                let descriptor = given.clone().or_else(|| taken.clone()).unwrap_or_else(unknown_payload);
                if known[from].is_none() && given.is_none() {
                    assumed[from].outputs.push(Output {
                        name: output.into(),
                        descriptor: descriptor.clone(),
                    });
                }
                if known[to].is_none() && taken.is_none() {
                    assumed[to].inputs.push(Input {
                        name: input.into(),
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
        let number = |name: &str| self.participants.iter().position(|entry| entry.setup.name == name);
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
            let giver = number(&from.0).filter(|&giver| certain(giver));
            let output = giver.and_then(|giver| interfaces[giver].outputs.iter().find(|port| port.name == from.1));
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
        if !mistakes.is_empty() {
            return Err(self.source.error(mistakes));
        }
        let specs = self
            .participants
            .iter()
            .zip(interfaces)
            .map(|(entry, interface)| ParticipantSpec {
                name: entry.setup.name.clone(),
                period: entry.period,
                offset: entry.offset,
                interface: interface.clone(),
            });
        let refuse = |errors: Vec<PlanError>| {
            let mistakes = errors
                .iter()
                .map(|error| self.source.mistake(&self.place(error), error.to_string()));
            self.source.error(mistakes.collect())
        };
        let mut plan = Plan::build(specs.collect(), &links, self.duration, self.seed).map_err(refuse)?;
        let faults = self.faults.signals(&self.source, &plan, certain);
        plan.disturb(faults.map_err(|mistakes| self.source.error(mistakes))?)
            .map_err(refuse)?;
        Ok(plan)
    }

    /// The key that a plan's error is about.
    fn place(&self, error: &PlanError) -> String {
        let connection = |link: &str| {
            let exact = self.connections.iter().find(|(name, _)| name == link);
            let part = || {
                self.connections
                    .iter()
                    .find(|(name, _)| link.starts_with(&format!("{name}-")))
            };
            exact
                .or_else(part)
                .map_or("connections".to_owned(), |(name, _)| format!("connections.{name}"))
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
}

/// Stands for a payload that nobody has described yet.
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

/// Reads one section; a mistake gets the key it is about.
pub(super) fn typed<T: DeserializeOwned>(source: &Source, key: &str, value: Value) -> Result<T, Mistake> {
    let table = value.clone();
    value.try_into::<T>().map_err(|error: toml::de::Error| {
        let reason = error.message().to_owned();
        // Serde names an unknown key in its message only; and for a wrong value the first key that fails alone.
        let named = reason
            .strip_prefix("unknown field `")
            .and_then(|rest| rest.split('`').next())
            .map(str::to_owned);
        let named = named.or_else(|| offending::<T>(&table));
        let key = match named {
            Some(name) if key.is_empty() => name,
            Some(name) => format!("{key}.{name}"),
            None => key.to_owned(),
        };
        source.mistake(&key, reason)
    })
}

/// The key without which the error of a table is another one.
fn offending<T: DeserializeOwned>(value: &Value) -> Option<String> {
    let table = value.as_table()?;
    let message = |table: &Table| {
        Value::Table(table.clone())
            .try_into::<T>()
            .err()
            .map(|error| error.message().to_owned())
    };
    let whole = message(table)?;
    table
        .keys()
        .find(|key| {
            let mut without = table.clone();
            without.remove(*key);
            message(&without).is_none_or(|other| other != whole)
        })
        .cloned()
}

fn resolve(source: &Source, folder: &Path, name: &str, entry: ParticipantEntry, seed: u64) -> Result<Entry, Mistake> {
    let runs = program(source, folder, &format!("participants.{name}.run"), entry.run)?;
    let on_failure = match entry.on_failure {
        OnFailureEntry::Named(Named::Stop) => OnFailure::Stop,
        OnFailureEntry::Named(Named::RestartFromCheckpoint) => OnFailure::Restart,
        OnFailureEntry::Substitute(entry) => {
            let key = format!("participants.{name}.on-failure.substitute");
            OnFailure::Substitute(program(source, folder, &key, entry.substitute)?)
        }
    };
    if !entry.period.is_positive() {
        let reason = format!("the period is {}; it must be positive", entry.period);
        return Err(source.mistake(&format!("participants.{name}.period"), reason));
    }
    if let Some(time) = entry.start_within.filter(|time| !time.is_positive()) {
        let reason = format!("the time is {time}; it must be positive, such as \"120 s\"");
        return Err(source.mistake(&format!("participants.{name}.start-within"), reason));
    }
    let setup = Setup {
        name: name.to_owned(),
        parameters: entry.parameters,
        seed,
        period: entry.period.seconds(),
        offset: entry.offset.seconds(),
    };
    Ok(Entry {
        program: runs,
        period: entry.period,
        offset: entry.offset,
        setup,
        on_failure,
        start_within: entry.start_within,
        replaced: false,
    })
}
