//! Port discovery: a program is asked for its ports before the run in which it may take part.

use std::time::Instant;

use lockstep::control::Request;
use lockstep::participant::Interface;
use lockstep::transport::iceoryx::Domain;

use crate::run::options::Options;
use crate::run::timeout::ActiveTime;

use super::child::GRACE;
use super::handshake;
use super::monitor::Monitor;
use super::participants;
use crate::run::outcome::RunFailure;
use crate::scenario::{Entry, ORCHESTRATOR, OnFailure, Scenario};
use crate::scope::Scope;

/// The ports of `entry`, as [`ask`] returns them.
///
/// # Errors
/// Those of [`ask`].
pub fn ports(scenario: &Scenario, entry: &Entry, options: &Options) -> Result<Interface, RunFailure> {
    query_ports(scenario, entry, options, &Monitor::new(options.interrupt.clone()))
}

fn query_ports(
    scenario: &Scenario,
    entry: &Entry,
    options: &Options,
    monitor: &Monitor,
) -> Result<Interface, RunFailure> {
    if let Some(factory) = scenario.builtins().factory_of(&entry.program) {
        let made = factory(&entry.setup);
        let made = made.map_err(|error| scenario.refusal(entry, &error.key, &error.reason))?;
        return Ok(made.interface());
    }
    let mut interfaces = query_monitored(scenario, &[entry], options, monitor)?;
    Ok(interfaces.remove(0))
}

/// The ports of `entries`, which are external programs with different names. The programs are started only for that, side by side
/// in their own domain, and ended again.
///
/// # Errors
/// A program that does not enter, describes no ports, or refuses its parameters.
pub fn ask(scenario: &Scenario, entries: &[&Entry], options: &Options) -> Result<Vec<Interface>, RunFailure> {
    query_monitored(scenario, entries, options, &Monitor::new(options.interrupt.clone()))
}

fn query_monitored(
    scenario: &Scenario,
    entries: &[&Entry],
    options: &Options,
    monitor: &Monitor,
) -> Result<Vec<Interface>, RunFailure> {
    if entries.is_empty() {
        return Ok(Vec::new());
    }
    let scope = Scope::create()?;
    let address = scope.address();
    let log_folder = address.folder.clone();
    let domain = Domain::enter(address, ORCHESTRATOR)?;
    let log = |name: &str| log_folder.join(format!("words.{name}"));
    let mut handles = participants::start_all(scenario, entries, &domain, options, None, log)?;
    let mut waited = ActiveTime::since(Instant::now());
    for handle in &mut handles {
        participants::await_entry(handle, &mut waited, monitor)?;
    }
    let interfaces = handshake::handshake_all(scenario, entries, &[], &mut handles, monitor)?;
    for handle in &mut handles {
        let _ = handle.request(&Request::Terminate, monitor);
    }
    let started = Instant::now();
    for handle in &mut handles {
        handle.process.shut_down(GRACE.saturating_sub(started.elapsed()));
    }
    Ok(interfaces)
}

/// Checks that each program that may take over in mid-run has the ports of the participant that it replaces, which are `known`.
///
/// # Errors
/// The first program with other ports and the difference, or what is wrong with its program.
pub(crate) fn check_substitutes(
    scenario: &Scenario,
    known: &[Interface],
    options: &Options,
    monitor: &Monitor,
) -> Result<(), RunFailure> {
    let compare = |entry: &Entry, slot: usize| -> Result<(), RunFailure> {
        let ports = query_ports(scenario, entry, options, monitor).map_err(|failure| match failure {
            RunFailure::Participant { participant, reason } => {
                let reason = format!("{}, which may replace it, {reason}", entry.program);
                let substitute = || RunFailure::Substitute { participant, reason };
                // A participant of the run itself may have failed meanwhile.
                monitor.failure().unwrap_or_else(substitute)
            }
            other => other,
        })?;
        match ports.difference(&known[slot]) {
            Some(difference) => {
                let reason = format!(
                    "{} has other ports than `{}`: {difference}",
                    entry.program, entry.setup.name
                );
                Err(scenario.program_refusal(entry, &reason).into())
            }
            None => Ok(()),
        }
    };
    for substitution in &scenario.substitutions {
        compare(&substitution.entry, substitution.participant)?;
    }
    for (slot, before) in scenario.participants.iter().enumerate() {
        if let OnFailure::Substitute(program) = &before.on_failure {
            compare(&before.replaced_by(program), slot)?;
        }
    }
    Ok(())
}
