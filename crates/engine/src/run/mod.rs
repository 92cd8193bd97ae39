//! One run, from a scenario to a verdict.

mod drive;
mod executor;
mod failed;
mod handle;
mod in_loop;
mod inputs;
mod log;
mod options;
mod outcome;
mod pace;
pub(crate) mod prepare;
mod processes;
mod recording;
mod recovery;
mod saved;
mod state;
mod stops;
mod timeout;

use std::sync::Arc;

pub use drive::{AsInstant, Checkpoint};
pub use handle::Run;
pub(crate) use in_loop::batched::BatchedRun;
pub(crate) use log::last_lines;
pub use options::{Options, Origin, Overrun, Wait};
pub use outcome::{Ending, Outcome, RunFailure};
pub use pace::report::{Lateness, PaceReport, factor};
pub use pace::traced::TraceSummary;
pub use prepare::{CheckedScenario, check, check_here, check_with_programs};
pub use processes::child::{end_with_parent, own_program, set_own_program};
pub use processes::placement::Placement;
pub use processes::sigbus::guard as guard_memory;
pub(crate) use recording::guard::{Forbidden, SampleGuard};
pub use recording::newest::Sample;
pub use recording::recorded_part::RecordedPart;
pub use recording::store::Record;
pub use recording::streams::streams;
pub use saved::branch::{Branch, branch};
pub use saved::continuation::check_branch;

pub use processes::{port_discovery, resources};
pub use recording::faults;
pub use saved::checkpoint;

pub use crate::scenario::ORCHESTRATOR;

use crate::scenario::Scenario;

/// How a process ended in words: exit status or signal.
pub fn ending_of_process(status: std::process::ExitStatus) -> String {
    processes::child::ParticipantProcess::describe_exit(status)
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
