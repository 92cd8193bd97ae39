//! One run, from a scenario to a verdict.

mod abreast;
mod agenda;
mod attend;
mod awake;
mod branch;
mod bus;
pub mod checkpoint;
mod child;
mod continuation;
mod course;
mod crew;
pub mod describe;
mod direct;
mod drive;
mod executor;
mod explain;
mod fallen;
pub mod faults;
mod guard;
mod handle;
mod handshake;
mod held;
mod horizon;
mod in_process;
mod inputs;
mod instants;
mod kept;
mod lanes;
mod lateness;
mod life;
mod log;
mod monitor;
mod newest;
mod notes;
mod observed;
mod options;
mod outcome;
mod pace;
mod place;
mod placement;
mod played;
mod ports;
pub(crate) mod prepare;
mod processes;
mod punctuality;
mod recall;
mod recording;
mod rest;
pub mod room;
mod said;
mod set_up;
mod slices;
mod standstill;
mod store;
mod streams;
mod survive;
mod take_up;
mod times;
mod trace;
mod traced;

use std::sync::Arc;

pub(crate) use abreast::Abreast;
pub use branch::{Branch, branch};
pub use bus::guard as guard_memory;
pub use child::{own_program, start_instead, tie};
pub use continuation::check_branch;
pub use drive::{Checkpoint, Instantlike};
pub(crate) use guard::{Forbidden, Watch};
pub use handle::Run;
pub use kept::Kept;
pub(crate) use log::last_lines;
pub use newest::Sample;
pub use options::{Options, Origin, Overrun, Wait};
pub use outcome::{Ending, Outcome, RunFailure};
pub use placement::Placement;
pub use prepare::{Known, check, check_here, check_with_programs};
pub use punctuality::{Lateness, Punctuality, factor};
pub use store::Record;
pub use streams::streams;
pub use traced::Traced;

pub use crate::scenario::ORCHESTRATOR;

use crate::scenario::Scenario;

/// How a process ended in words: exit status or signal.
pub fn ending_of_process(status: std::process::ExitStatus) -> String {
    child::Participant::ending(status)
}

/// Runs `scenario`.
///
/// # Errors
/// What prevented the run before there was anything to record; later failures are in the [`Outcome`].
pub fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    run_shared(Arc::new(scenario.clone()), options.clone())
}

/// [`run`] with shared arguments, for callers that do not need them afterwards.
pub(crate) fn run_shared(scenario: Arc<Scenario>, options: Options) -> Result<Outcome, RunFailure> {
    Run::begin(scenario, options, false).map(Run::finish)
}
