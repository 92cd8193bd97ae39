//! Start-up of a run: processes, handshake, plan, tape, services and positions, up to the first step.
//!
//! Before the first step no state can be lost. So if the `on-failure` of a participant that fails is a restart or a substitute, all
//! participants are started again in a fresh place, the failed one with the program that its policy names.

use std::sync::Arc;
use std::time::Instant;

use lockstep::participant::Interface;
use lockstep::plan::Plan;
use lockstep::time::Rational;
use tape::folder::RunFolder;
use tape::{Event, EventKind};

use super::executor::{Failures, Processes, Rounds};
use super::handshake;
use super::monitor::Monitor;
use super::participants::{self, ParticipantHandle};
use super::place::Place;
use super::placement::Placement;
use super::port_discovery;
use super::resources;
use crate::run::failed::{RESTARTS_MAX, Restarts};
use crate::run::options::Options;
use crate::run::outcome::RunFailure;
use crate::run::prepare::{self, Known, Ready, Start};
use crate::run::recording::recorder::Recorder;
use crate::run::timeout::Awake;
use crate::scenario::{Entry, OnFailure, Scenario};
use crate::scope::Scope;

/// What follows from the ports, and is the same in every attempt.
struct Basis {
    interfaces: Vec<Interface>,
    plan: Arc<Plan>,
    recorder: Recorder,
    start: Start,
}

/// What an attempt has created.
type Begun = (Scope, Place, Placement, Vec<ParticipantHandle>);

/// The arguments of every attempt.
struct SetUp<'a> {
    scenario: &'a Scenario,
    options: &'a Options,
    /// The ports of each builtin participant.
    known: &'a [Option<Interface>],
    /// The plan as far as it is known before programs have described their ports.
    sketch: &'a Plan,
    folder: &'a RunFolder,
    monitor: &'a Monitor,
    /// Whether a program may ask for the samples of any stream.
    asked: bool,
}

/// Starts the programs of `entries`, and creates everything that they need.
///
/// # Errors
/// Failures that no `on-failure` covers.
pub(crate) fn set_up(
    scenario: &Scenario,
    options: &Options,
    known: &Known,
    mut entries: Vec<Entry>,
    folder: &RunFolder,
    monitor: &Monitor,
    asked: bool,
) -> Result<(Ready, Processes), RunFailure> {
    let all = SetUp {
        scenario,
        options,
        known: &known.interfaces,
        sketch: &known.plan,
        folder,
        monitor,
        asked,
    };
    let (mut basis, mut programs) = (None, 0);
    let mut failures = vec![0; entries.len()];
    let mut events: Vec<Event> = Vec::new();
    loop {
        let attempt = all.attempt(&entries, &mut basis, &mut programs);
        let (participant, reason) = match (attempt, basis.take()) {
            (Ok(begun), Some(made)) => return together(options, entries, made, begun, programs, events),
            (Err(RunFailure::Participant { participant, reason }), made) => {
                basis = made;
                (participant, reason)
            }
            (Err(other), _) => return Err(other),
            (Ok(_), None) => unreachable!("an attempt that succeeds has a basis"),
        };
        let number = entries.iter().position(|entry| entry.setup.name == participant);
        let event = number.and_then(|number| {
            failures[number] += 1;
            apply_policy(&mut entries[number], failures[number], &reason)
        });
        let Some(event) = event else {
            let mut reason = reason;
            if number.is_some_and(|number| failures[number] > RESTARTS_MAX) {
                reason += &format!("\n(started again {RESTARTS_MAX} times without getting any further)");
            }
            return Err(RunFailure::Participant { participant, reason });
        };
        options.progress.say(&format!(
            "participant `{participant}`: {reason}\nparticipant `{participant}`: {}",
            event.text
        ));
        events.push(event);
    }
}

/// Combines the results of a successful attempt into what the run needs.
fn together(
    options: &Options,
    entries: Vec<Entry>,
    basis: Basis,
    (scope, place, placement, handles): Begun,
    programs: usize,
    events: Vec<Event>,
) -> Result<(Ready, Processes), RunFailure> {
    let Basis {
        plan,
        mut recorder,
        start,
        ..
    } = basis;
    let time = plan.timebase.time(start.from).unwrap_or_default();
    let words = |event: &Event| {
        format!(
            "participant `{}`: {}",
            event.participant.as_deref().unwrap_or_default(),
            event.text
        )
    };
    let recovered = events.iter().map(words).collect();
    if let Some(denied) = &placement.denied {
        options.progress.say(denied);
    }
    for event in events {
        recorder.event(&Event { time, ..event })?;
    }
    let processes = Processes {
        handles,
        place,
        scope,
        monitor: Monitor::new(options.interrupt.clone()),
        programs,
        failures: Failures {
            restarts: vec![Restarts::default(); entries.len()],
            unhandled: Vec::new(),
        },
        placement: placement.reason,
        rounds: Rounds::new(options.patience()),
    };
    let ready = Ready {
        entries,
        plan,
        recorder,
        start,
        recovered,
    };
    Ok((ready, processes))
}

/// Applies the policy of a participant that has failed `count` times to its entry. Returns the event, or `None` when the run ends.
fn apply_policy(entry: &mut Entry, count: u32, reason: &str) -> Option<Event> {
    let first_line = reason.lines().next().unwrap_or_default();
    let (kind, text) = match entry.on_failure.clone() {
        OnFailure::Stop => return None,
        OnFailure::Restart if count > RESTARTS_MAX => return None,
        OnFailure::Restart => (
            EventKind::Restart,
            format!("started again before the run began: {first_line}"),
        ),
        OnFailure::Substitute(program) => {
            *entry = entry.replaced_by(&program);
            let text = format!(
                "{} takes over before the run began, because of a failure: {first_line}",
                entry.program
            );
            (EventKind::Substitution, text)
        }
    };
    Some(Event {
        time: Rational::ZERO,
        kind,
        participant: Some(entry.setup.name.clone()),
        text,
    })
}

impl SetUp<'_> {
    /// One attempt in its own place. After an error all processes of the attempt have ended.
    fn attempt(&self, entries: &[Entry], basis: &mut Option<Basis>, programs: &mut usize) -> Result<Begun, RunFailure> {
        let (scenario, options) = (self.scenario, self.options);
        let scope = Scope::create()?;
        let reserved = resources::reserve(self.sketch, &scope.address().folder, scenario.moves())?;
        reserved.give_services();
        let names = entries.iter().map(|entry| entry.setup.name.as_str());
        let (domain, ports) = Place::enter(scope.address(), names)?;
        let mut handles = Vec::new();
        for (entry, ports) in entries.iter().zip(ports) {
            let name = &entry.setup.name;
            let mut log = self.folder.stderr(name);
            if log.exists() {
                *programs += 1;
                log = self.folder.stderr(&format!("{name}.{programs}"));
            }
            let process = participants::start(self.scenario, entry, &domain, &log, options.detail())?;
            handles.push(ParticipantHandle::new(
                process,
                ports,
                participants::start_within(entry, options),
            ));
        }
        // Every wait below ends when any of the participants fails.
        let monitor = self.monitor.over(handles.iter().map(|handle| &handle.process));
        let monitor = monitor.map_err(|error| RunFailure::Other(error.to_string()))?;
        let mut waited = Awake::since(Instant::now());
        for handle in &mut handles {
            participants::arrive(handle, &mut waited, &monitor)?;
        }
        let known: Vec<Option<&Interface>> = match &*basis {
            Some(before) => before.interfaces.iter().map(Some).collect(),
            None => self.known.iter().map(Option::as_ref).collect(),
        };
        let interfaces = handshake::handshake_all(scenario, entries, &known, &mut handles, &monitor)?;
        let Basis { plan, start, .. } = match basis {
            Some(basis) => basis,
            None => {
                let plan = scenario.plan(&interfaces)?;
                port_discovery::check_substitutes(scenario, &interfaces, options, &monitor)?;
                let mut recorder = prepare::recorder(scenario, plan, options, Some(self.folder), self.asked)?;
                let plan = recorder.plan.clone();
                let start = prepare::start(&plan, options, &mut recorder)?;
                basis.insert(Basis {
                    interfaces,
                    plan,
                    recorder,
                    start,
                })
            }
        };
        let place = Place::create_services(domain, plan)?;
        let placement = Placement::choose(plan, options);
        let rings = reserved.give_rings(plan);
        let connecting = handshake::Connecting {
            placement: &placement,
            rings: &rings,
            monitor: &monitor,
        };
        connecting.all(&mut handles, plan, start.positions.as_deref())?;
        Ok((scope, place, placement, handles))
    }
}
