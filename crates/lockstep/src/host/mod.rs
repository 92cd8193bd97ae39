//! The host of a participant in a process of its own: from the orchestrator's first request to its last.

mod backoff;
mod connected;
mod error;
mod neighbours;
mod session;
mod spans;

pub use error::HostError;

use std::env;
use std::process::ExitCode;
use std::sync::Arc;

use crate::participant::{ParameterError, Participant, Setup};
use crate::span::{Detail, SPANS};
use crate::transport::iceoryx::Address;

/// The environment variable with the address of the run.
pub const ADDRESS: &str = "ESCAPEMENT_RUN";
/// The environment variable with the participant's name.
pub const PARTICIPANT: &str = "ESCAPEMENT_PARTICIPANT";

/// The `main` of a participant's program: joins the run that the environment names, creates the participant with `factory`, and runs
/// until the participant has finished or receives the command to terminate.
///
/// Prints the reason of a failure to standard error and returns exit code 1; 2 when it was not started by an orchestrator.
///
/// The process should exit then: what it has open in shared memory at the end of the run is left to its exit.
pub fn run(
    factory: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    program: &str,
) -> ExitCode {
    let (address, name) = match (env::var(ADDRESS), env::var(PARTICIPANT)) {
        (Ok(address), Ok(name)) => (address, name),
        _ => {
            eprintln!(
                "{program}: this program takes part in a run and is started by the orchestrator; name it in a scenario as \
                 run = {{ exe = \"…\" }} ({ADDRESS} and {PARTICIPANT} are not set)"
            );
            return ExitCode::from(2);
        }
    };
    let outcome = address.parse::<Address>().map_err(HostError::from).and_then(|address| {
        // A participant must not outlive its orchestrator, however the orchestrator ends.
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))
            .map_err(|error| HostError::Orphan(error.to_string()))?;
        let spans = env::var(SPANS).ok().and_then(|word| Detail::parse(&word));
        let mut state = session::SessionState::new(&name, program, Arc::new(factory), spans);
        let mut address = Some(address);
        // A participant that moves releases everything of the old address first.
        while let Some(at) = address {
            (address, state) = session::Session::open(at, state)?.run()?;
        }
        Ok(())
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(1)
        }
    }
}
