//! One run, from a scenario to a verdict.

mod agenda;
mod awake;
mod bus;
pub mod checkpoint;
mod child;
mod conduct;
mod crew;
pub mod describe;
mod explain;
pub mod faults;
mod guard;
mod horizon;
mod in_process;
mod instants;
mod log;
mod monitor;
mod outcome;
mod place;
mod placement;
mod played;
pub(crate) mod prepare;
mod recording;
pub mod room;
mod set_up;
mod slices;
mod survive;
mod take_up;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use lockstep::plan::Plan;
use lockstep::time::Rational;
use tape::folder::RunFolder;

pub use child::{own_program, tie};
pub(crate) use guard::Watch;
pub use outcome::{Ending, ORCHESTRATOR, Outcome, RunFailure};
pub use placement::Placement;
pub use prepare::{Known, check, check_here, check_with_programs};
pub use recording::streams;

use crate::live::Steering;
use crate::observer::{Event, Interrupt, Progress};
use crate::scenario::Scenario;

/// How a process ended in words: exit status or signal.
pub fn ending_of_process(status: std::process::ExitStatus) -> String {
    child::Participant::ending(status)
}

/// How participants wait, as the user chooses it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Wait {
    /// As the placement recommends.
    #[default]
    Auto,
    /// Spin: fastest with a core for everybody, and granted only there.
    Spin,
    /// Let others run.
    Yield,
    /// Sleep until woken.
    Sleep,
}

impl Wait {
    /// All of them with their names.
    pub const ALL: [(&'static str, Wait); 4] = [
        ("auto", Wait::Auto),
        ("spin", Wait::Spin),
        ("yield", Wait::Yield),
        ("sleep", Wait::Sleep),
    ];
}

/// Where a run goes on that was begun by another one.
#[derive(Debug, Clone)]
pub struct Origin {
    /// The other run's folder.
    pub run: PathBuf,
    /// Its state.
    pub checkpoint: checkpoint::Checkpoint,
}

/// What the command line says about a run besides the scenario.
#[derive(Clone, Default)]
pub struct Options {
    /// All participants in this process.
    pub in_process: bool,
    /// The run folder; chosen under `runs` when not given.
    pub out: Option<PathBuf>,
    /// Replace the run in that folder, if there is one.
    pub force: bool,
    /// Receives what happens.
    pub progress: Progress,
    /// Asks for an end in order.
    pub interrupt: Interrupt,
    /// Simulated seconds per second of wall time; as fast as possible when not given.
    pub pace: Option<f64>,
    /// Come to rest here and wait for the user.
    pub pause_at: Vec<Rational>,
    /// Keep the state of the run in a file this often, simulated.
    pub checkpoint_every: Option<Rational>,
    /// Keep the state of the run in a file at these instants.
    pub checkpoint_at: Vec<Rational>,
    /// Go on from here; from the beginning when not given.
    pub origin: Option<Origin>,
    /// How participants wait.
    pub wait: Wait,
    /// Leave the choice of cores to the operating system.
    pub no_placement: bool,
    /// How long a participant may compute without progress before the run is given up, s.
    pub patience_s: f64,
    /// How long each program may take to enter the run and to answer a request, whatever the scenario says of it.
    pub start_within: Option<Duration>,
    /// Whoever moves the horizon from outside.
    pub steering: Option<Arc<Steering>>,
}

impl Options {
    /// [`Options::patience_s`] as far as a duration goes.
    fn patience(&self) -> Duration {
        Duration::try_from_secs_f64(self.patience_s).unwrap_or(Duration::MAX)
    }

    /// Tells whoever watches that there is a run.
    fn begin(&self, plan: &Plan, folder: &RunFolder) {
        let duration_s = plan.timebase.seconds(plan.end);
        self.progress.report(Event::Begun { duration_s });
        if let Some(steering) = &self.steering {
            steering.begin(plan, folder.root().to_owned());
        }
    }
}

/// Runs `scenario`.
///
/// # Errors
/// What stopped the run before there was anything to record; what went wrong later is in the [`Outcome`].
pub fn run(scenario: &Scenario, options: &Options) -> Result<Outcome, RunFailure> {
    instants::check(scenario.duration, options)?;
    if options.in_process {
        in_process::run(scenario, options)
    } else {
        conduct::run(scenario, options)
    }
}
