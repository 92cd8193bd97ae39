//! Branches at instants without a checkpoint: the run is repeated unchanged from the previous checkpoint up to the branch.

use std::path::Path;

use lockstep::time::{Rational, TickError};

use super::continuation::timebase;
use crate::run::handle::Run;
use crate::run::options::{Options, Origin};
use crate::run::outcome::{Ending, RunFailure};
use crate::run::stops::instants;
use crate::scenario::Scenario;
use crate::scope::Scope;

/// A run that was continued unchanged up to where a branch begins. Its recording exists until this is dropped.
pub struct Branch {
    /// Where the branch begins.
    pub origin: Origin,
    // The folder is removed with it, also when this process is killed.
    _scope: Scope,
}

/// How the name of a branch's folder begins; a random part follows.
const MARK: &str = ".branch-";

/// Continues from `origin`, a run of `scenario`, as fast as possible and without a pause, and saves the state at `to`. Its
/// temporary folder is created next to the one in `options`.
///
/// # Errors
/// When `to` is not between the checkpoint and the end, or when the run fails before it.
pub fn branch(scenario: &Scenario, options: &Options, origin: Origin, to: Rational) -> Result<Branch, RunFailure> {
    let timebase = timebase(scenario).map_err(other)?;
    let end = timebase.ceil(scenario.duration).map_err(other)?;
    instants::check_from(to, scenario.duration, end, &timebase)?;
    let beside = options
        .out
        .as_deref()
        .and_then(Path::parent)
        .unwrap_or(Path::new("runs"));
    let scope = Scope::create()?;
    let folder = scope.scratch_in(beside, MARK)?;
    let options = Options {
        out: Some(folder.clone()),
        force: true,
        pace: None,
        trace: None,
        pause_at: Vec::new(),
        checkpoint_every: None,
        checkpoint_at: vec![to],
        steering: None,
        origin: Some(origin),
        ..options.clone()
    };
    let mut run = Run::begin(std::sync::Arc::new(scenario.clone()), options, false)?;
    run.run_until(Some(run.run_state.plan.timebase.ceil(to).map_err(other)?));
    let checkpoint = run.run_state.last_checkpoint.take().filter(|_| run.over.is_none());
    let outcome = run.conclude();
    match (checkpoint, outcome.ending) {
        (Some(checkpoint), Ending::Complete) => Ok(Branch {
            origin: Origin {
                run: folder,
                checkpoint,
            },
            _scope: scope,
        }),
        (_, Ending::Failed { participant, reason }) => Err(RunFailure::Participant { participant, reason }),
        (_, Ending::Stopped { .. }) => Err(RunFailure::Interrupted),
        (None, Ending::Complete) => Err(RunFailure::Other(format!("the run came to its end before t = {to}"))),
    }
}

fn other(error: TickError) -> RunFailure {
    RunFailure::Other(error.to_string())
}
