//! What a program says of its ports, asked before the run in which it may have a part.

use std::time::{Duration, Instant};

use lockstep::control::Request;
use lockstep::participant::Interface;

use super::Options;
use super::awake::Awake;
use super::conduct::GRACE;
use super::crew::{self, Member};
use super::monitor::Monitor;
use super::outcome::RunFailure;
use super::place::Place;
use crate::scenario::{Entry, OnFailure, Program, Scenario, ScenarioError};
use crate::scope::Scope;

/// The ports of `entry`. A program of its own is started for that alone, in a place of its own, and ended again.
///
/// # Errors
/// A program that does not enter, describes no ports, or refuses its parameters.
pub fn ports(scenario: &Scenario, entry: &Entry, options: &Options) -> Result<Interface, RunFailure> {
    ask_for_ports(scenario, entry, options, &Monitor::new(options.interrupt.clone()))
}

fn ask_for_ports(
    scenario: &Scenario,
    entry: &Entry,
    options: &Options,
    monitor: &Monitor,
) -> Result<Interface, RunFailure> {
    if let Program::Builtin(name) = &entry.program
        && let Some(factory) = scenario.catalogue().factory(name)
    {
        let made = factory(&entry.setup);
        let made = made.map_err(|error| scenario.refusal(&entry.setup.name, &error.key, &error.reason))?;
        return Ok(made.interface());
    }
    let scope = Scope::create()?;
    let address = scope.address();
    let log = address.folder.join("words");
    let name = entry.setup.name.as_str();
    let within: Duration = crew::start_within(entry, options);
    let (domain, ports) = Place::enter(address, std::iter::once(name))?;
    let process = crew::start(entry, &domain, &log)?;
    let mut members: Vec<Member> = std::iter::once(process)
        .zip(ports)
        .map(|(process, ports)| Member::new(process, ports, within))
        .collect();
    let member = &mut members[0];
    crew::arrive(member, &mut Awake::since(Instant::now()), monitor)?;
    let interface = crew::introduce(scenario, entry, None, member, monitor)?;
    let _ = member.ask(&Request::Terminate, monitor);
    member.process.bring_down(GRACE);
    Ok(interface)
}

/// Whether everybody who may take over in mid-run has the ports of who is there before, which are `known`.
///
/// # Errors
/// The first one that has not, with the difference, or what is wrong with its program.
pub(super) fn check_substitutes(
    scenario: &Scenario,
    known: &[Interface],
    options: &Options,
    monitor: &Monitor,
) -> Result<(), RunFailure> {
    let compare = |entry: &Entry, seat: usize, refuse: &dyn Fn(&str) -> ScenarioError| {
        let ports = match ask_for_ports(scenario, entry, options, monitor) {
            Ok(ports) => ports,
            // Somebody of the run itself has failed meanwhile.
            Err(RunFailure::Participant { reason, .. }) => {
                let refusal = || refuse(&format!("{} {reason}", entry.program)).into();
                return Err(monitor.failure().unwrap_or_else(refusal));
            }
            Err(other) => return Err(other),
        };
        match ports.difference(&known[seat]) {
            Some(difference) => {
                let reason = format!(
                    "{} has other ports than `{}`: {difference}",
                    entry.program, entry.setup.name
                );
                Err(refuse(&reason).into())
            }
            None => Ok(()),
        }
    };
    for substitution in &scenario.substitutions {
        let seat = substitution.participant;
        let entry = substitution.entry(&scenario.participants[seat]);
        compare(&entry, seat, &|reason| {
            scenario.substitution_refusal(substitution, reason)
        })?;
    }
    for (seat, before) in scenario.participants.iter().enumerate() {
        if let OnFailure::Substitute(program) = &before.on_failure {
            let entry = before.replaced_by(program);
            compare(&entry, seat, &|reason| {
                scenario.policy_refusal(&entry.setup.name, reason)
            })?;
        }
    }
    Ok(())
}
