//! `[[faults]]`: fault injection, with signal faults, link faults and substitutions.

mod entry;
mod signal;

use std::collections::{BTreeSet, HashMap, HashSet};

use lockstep::fault::{FaultWindow, LinkFault, SignalFault};
use lockstep::plan::Plan;
use lockstep::time::Rational;

use super::entry::Entry;
use super::error::Mistake;
use super::names::Names;
use super::source::SourceContext;
use super::spec::{FaultSpec, State, Time};
use entry::FaultType;
use signal::DeclaredSignalFault;

pub(super) use signal::values;

/// The most substitutions of a run: each needs its own place in shared memory (`scope`), and restarts need some as well.
const SUBSTITUTIONS_MAX: usize = 1000;

/// Another program replaces a participant in mid-run.
#[derive(Debug, Clone)]
pub struct Substitution {
    /// The fault's name.
    pub name: String,
    /// When it takes place.
    pub at: Rational,
    /// The number of the participant that it replaces.
    pub participant: usize,
    /// The program that runs from then on.
    pub entry: Entry,
    /// Whether it has its own parameters; otherwise it has those that the scenario declares for the participant.
    pub own_parameters: bool,
    /// The state that it starts with.
    pub state: State,
    /// Its key in the scenario.
    pub(super) key: String,
}

/// The faults that act on samples: signal faults and link faults.
#[derive(Debug, Clone, Default)]
pub(super) struct Faults {
    signals: Vec<DeclaredSignalFault>,
    /// The link faults, by connection.
    links: HashMap<String, Vec<LinkFault>>,
}

impl Faults {
    /// The link faults of the connection called `name`.
    pub(super) fn of_connection(&self, name: &str) -> Vec<LinkFault> {
        self.links.get(name).cloned().unwrap_or_default()
    }

    /// The keys of all faults that act on samples, with their start times.
    pub(super) fn start_times(&self) -> impl Iterator<Item = (String, Rational)> {
        let signals = self.signals.iter().map(DeclaredSignalFault::start_time);
        let signals = signals.map(|(key, at)| (key.to_owned(), at));
        let links = self.links.values().flatten();
        signals.chain(links.map(|fault| (format!("faults.{}", fault.name), fault.span.at)))
    }

    /// The signal faults, resolved against the ports of `plan`; a fault that cannot be resolved because a participant's ports are
    /// not `certain` is left out.
    pub(super) fn signals(
        &self,
        source: &SourceContext,
        plan: &Plan,
        certain: impl Fn(usize) -> bool,
    ) -> Result<Vec<SignalFault>, Vec<Mistake>> {
        let (mut faults, mut mistakes) = (Vec::new(), Vec::new());
        for signal in &self.signals {
            match signal.resolve(plan, &certain) {
                Ok(fault) => faults.extend(fault),
                Err((key, reason)) => mistakes.push(source.mistake(&format!("{}.{key}", signal.key), reason)),
            }
        }
        if mistakes.is_empty() { Ok(faults) } else { Err(mistakes) }
    }
}

/// Reads all entries, as far as possible without the ports of the participants.
pub(super) fn read(
    source: &SourceContext,
    participants: &Names,
    resolved: &[Option<Entry>],
    connections: &Names,
    entries: &[FaultSpec],
    unread: &BTreeSet<usize>,
) -> Result<(Faults, Vec<Substitution>), Vec<Mistake>> {
    let mut reader = FaultReader {
        source,
        participants,
        resolved,
        connections,
        faults: Faults::default(),
        substitutions: Vec::new(),
    };
    let (mut mistakes, mut names) = (Vec::new(), HashSet::new());
    let positions = (0..).filter(|position| !unread.contains(position));
    for (position, entry) in positions.zip(entries) {
        let name = super::names::fault_name(entry.name.as_deref(), position);
        let key = format!("faults.{name}");
        if !lockstep::name::is_name(&name, lockstep::name::NAME_MAX) {
            let reason = format!("`{name}` is not a name: use up to 64 letters, digits, `_` and `-`");
            mistakes.push(source.mistake(&format!("{key}.name"), reason));
        } else if names.contains(&name) {
            let reason = format!("two faults are called `{name}`: give one of them another name");
            mistakes.push(source.mistake(&format!("{key}.name"), reason));
        } else if let Err(mistake) = reader.read_entry(&name, &key, entry) {
            mistakes.push(mistake);
        }
        names.insert(name);
    }
    if mistakes.is_empty() {
        reader.substitutions.sort_by_key(|substitution| substitution.at);
        Ok((reader.faults, reader.substitutions))
    } else {
        Err(mistakes)
    }
}

struct FaultReader<'a> {
    source: &'a SourceContext,
    participants: &'a Names,
    /// The participants; `None` for one that has mistakes itself.
    resolved: &'a [Option<Entry>],
    connections: &'a Names,
    faults: Faults,
    substitutions: Vec<Substitution>,
}

impl FaultReader<'_> {
    fn read_entry(&mut self, name: &str, key: &str, entry: &FaultSpec) -> Result<(), Mistake> {
        let refuse = |field: &str, reason: String| {
            let key = if field.is_empty() {
                key.to_owned()
            } else {
                format!("{key}.{field}")
            };
            self.source.mistake(&key, reason)
        };
        let fault_type = entry.fault_type().map_err(|(field, reason)| refuse(&field, reason))?;
        let (at, until) = (entry.at.checked(), entry.until.as_ref().map(Time::checked));
        if at.is_negative() {
            return Err(refuse("at", format!("{at} is before the start")));
        }
        if let Some(until) = until.filter(|until| *until <= at) {
            let reason = format!("{until} is not after the begin at {at}");
            return Err(refuse("until", reason));
        }
        let span = FaultWindow { at, until };
        match fault_type {
            FaultType::Signal { port, output } => {
                let signal = DeclaredSignalFault::new(name, key, span, port, output, entry);
                let signal = signal.map_err(|(field, reason)| refuse(&field, reason))?;
                if !self.participants.contains(&signal.port.0) {
                    let reason = self.participants.unknown("participant", &signal.port.0);
                    return Err(refuse(if output { "output" } else { "input" }, reason));
                }
                self.faults.signals.push(signal);
            }
            FaultType::Link { connection } => {
                if !self.connections.contains(&connection) {
                    let reason = self.connections.unknown("connection", &connection);
                    return Err(refuse("connection", reason));
                }
                let fault = entry.link_fault(name, span, &connection);
                let fault = fault.map_err(|(field, reason)| refuse(&field, reason))?;
                self.faults.links.entry(connection).or_default().push(fault);
            }
            FaultType::Substitution { participant } => {
                let number = self.participants.number(&participant);
                let number = number.ok_or_else(|| {
                    let reason = self.participants.unknown("participant", &participant);
                    refuse("substitute", reason)
                })?;
                let run = entry.run.as_ref().ok_or_else(|| {
                    refuse(
                        "",
                        "`run` is missing: name the program that replaces the participant".to_owned(),
                    )
                })?;
                let Some(before) = &self.resolved[number] else {
                    return Ok(());
                };
                if self.substitutions.len() == SUBSTITUTIONS_MAX {
                    let reason = format!("there are more than {SUBSTITUTIONS_MAX} substitutions: leave some out");
                    return Err(refuse("substitute", reason));
                }
                self.substitutions.push(Substitution {
                    name: name.to_owned(),
                    at,
                    participant: number,
                    own_parameters: entry.parameters.is_some(),
                    entry: before.substituted(self.source, key, run, entry.parameters.clone())?,
                    state: entry.state.unwrap_or_default(),
                    key: key.to_owned(),
                });
            }
        }
        Ok(())
    }
}
