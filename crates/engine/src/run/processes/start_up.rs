//! Start-up of a run: processes, handshake, plan, tape, services and positions, up to the first step.
//!
//! Before the first step no state can be lost. So if the `on-failure` of a participant that fails is a restart or a substitute, all
//! participants are started again in a new domain, the failed one with the program that its policy names.

use std::sync::Arc;
use std::time::Instant;

use lockstep::participant::Interface;
use lockstep::plan::Plan;
use lockstep::time::Rational;
use lockstep::transport::iceoryx::Domain;
use tape::folder::RunFolder;
use tape::{Event, EventKind};

use super::executor::{Failures, PeriodicTasks, Processes};
use super::handshake;
use super::monitor::Monitor;
use super::participants::{self, ParticipantHandle};
use super::placement::Placement;
use super::port_discovery;
use super::resources;
use super::run_services::{PlannedServices, RunServices};
use crate::run::failed::{RESTARTS_MAX, Restarts};
use crate::run::options::Options;
use crate::run::outcome::RunFailure;
use crate::run::prepare::{self, CheckedScenario, PreparedRun, StartPoint};
use crate::run::recording::recorder::Recorder;
use crate::run::timeout::ActiveTime;
use crate::scenario::{Entry, ORCHESTRATOR, OnFailure, Scenario};
use crate::scope::Scope;

/// What follows from the ports, and is the same in every attempt.
struct PlannedRun {
    interfaces: Vec<Interface>,
    plan: Arc<Plan>,
    recorder: Recorder,
    start: StartPoint,
}

/// What an attempt has created.
type StartedRun = (Scope, RunServices, Placement, Vec<ParticipantHandle>);

/// The arguments of every attempt.
struct StartUp<'a> {
    scenario: &'a Scenario,
    options: &'a Options,
    /// The ports of each builtin participant.
    known: &'a [Option<Interface>],
    /// The plan as far as it is known before programs have described their ports.
    sketch: &'a Plan,
    folder: &'a RunFolder,
    monitor: &'a Monitor,
    /// Whether a program drives the run and may query the samples of any stream.
    driven: bool,
}

/// Starts the programs of `entries`, and creates everything that they need.
///
/// # Errors
/// Failures that no `on-failure` covers.
pub(crate) fn set_up(
    scenario: &Scenario,
    options: &Options,
    known: &CheckedScenario,
    mut entries: Vec<Entry>,
    folder: &RunFolder,
    monitor: &Monitor,
    driven: bool,
) -> Result<(PreparedRun, Processes), RunFailure> {
    let all = StartUp {
        scenario,
        options,
        known: &known.interfaces,
        sketch: &known.plan,
        folder,
        monitor,
        driven,
    };
    let (mut planned, mut programs) = (None, 0);
    let mut failures = vec![0; entries.len()];
    let mut events: Vec<Event> = Vec::new();
    loop {
        let attempt = all.attempt(&entries, &mut planned, &mut programs);
        let (participant, reason) = match (attempt, planned.take()) {
            (Ok(started), Some(made)) => return assemble(options, entries, made, started, programs, events),
            (Err(RunFailure::Participant { participant, reason }), made) => {
                planned = made;
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
        options.progress.notice(&format!(
            "participant `{participant}`: {reason}\nparticipant `{participant}`: {}",
            event.text
        ));
        events.push(event);
    }
}

/// Combines the results of a successful attempt into what the run needs.
fn assemble(
    options: &Options,
    entries: Vec<Entry>,
    planned: PlannedRun,
    (scope, services, placement, handles): StartedRun,
    programs: usize,
    events: Vec<Event>,
) -> Result<(PreparedRun, Processes), RunFailure> {
    let PlannedRun {
        plan,
        mut recorder,
        start,
        ..
    } = planned;
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
        options.progress.notice(denied);
    }
    for event in events {
        recorder.event(&Event { time, ..event })?;
    }
    let processes = Processes {
        handles,
        services,
        scope,
        monitor: Monitor::new(options.interrupt.clone()),
        programs,
        failures: Failures {
            restarts: vec![Restarts::default(); entries.len()],
            unhandled: Vec::new(),
        },
        placement: placement.reason,
        periodic: PeriodicTasks::new(options.stall_timeout()),
    };
    let ready = PreparedRun {
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

impl StartUp<'_> {
    /// One attempt in its own domain. After an error all processes of the attempt have ended.
    fn attempt(
        &self,
        entries: &[Entry],
        planned: &mut Option<PlannedRun>,
        programs: &mut usize,
    ) -> Result<StartedRun, RunFailure> {
        let (scenario, options) = (self.scenario, self.options);
        let scope = Scope::create()?;
        let reserved = resources::reserve(self.sketch, &scope.address().folder, scenario.may_relocate())?;
        reserved.release_services();
        let domain = Domain::enter(scope.address(), ORCHESTRATOR)?;
        let log = |name: &str| {
            let log = self.folder.stderr(name);
            if !log.exists() {
                return log;
            }
            *programs += 1;
            self.folder.stderr(&format!("{name}.{programs}"))
        };
        let mut handles = participants::start_all(scenario, entries, &domain, options, options.detail(), log)?;
        // A participant with other ports than expected is refused below, so with these the plan is certain. What follows from it is
        // created while the participants start.
        let expected = match &*planned {
            Some(before) => Some(&*before.plan),
            None => self.known.iter().all(Option::is_some).then_some(self.sketch),
        };
        let ahead = expected
            .map(|plan| PlannedServices::create(&domain, plan))
            .transpose()?;
        // Every wait below ends when any of the participants fails.
        let monitor = self.monitor.monitoring(handles.iter().map(|handle| &handle.process));
        let monitor = monitor.map_err(|error| RunFailure::Other(error.to_string()))?;
        let mut waited = ActiveTime::since(Instant::now());
        for handle in &mut handles {
            participants::await_entry(handle, &mut waited, &monitor)?;
        }
        let known: Vec<Option<&Interface>> = match &*planned {
            Some(before) => before.interfaces.iter().map(Some).collect(),
            None => self.known.iter().map(Option::as_ref).collect(),
        };
        let interfaces = handshake::handshake_all(scenario, entries, &known, &mut handles, &monitor)?;
        let PlannedRun { plan, start, .. } = match planned {
            Some(planned) => planned,
            None => {
                let plan = scenario.plan(&interfaces)?;
                port_discovery::check_substitutes(scenario, &interfaces, options, &monitor)?;
                let mut recorder = prepare::create_recorder(scenario, plan, options, Some(self.folder), self.driven)?;
                let plan = recorder.plan.clone();
                let start = prepare::start_point(&plan, options, &mut recorder)?;
                planned.insert(PlannedRun {
                    interfaces,
                    plan,
                    recorder,
                    start,
                })
            }
        };
        let services = match ahead {
            Some(services) => services,
            None => PlannedServices::create(&domain, plan)?,
        };
        let placement = Placement::choose(plan, options);
        let rings = reserved.release_rings(plan);
        let connector = handshake::Connector {
            placement: &placement,
            rings: &rings,
            monitor: &monitor,
        };
        connector.connect_all(&mut handles, plan, start.positions.as_deref())?;
        Ok((scope, RunServices::new(domain, services), placement, handles))
    }
}
