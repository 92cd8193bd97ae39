//! `escapement tune SPEC`: gains by structured H-infinity, verified before they are written.

mod lookup;
mod matrices;
mod print;
mod sliding;
mod verify;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use synthesis::robot::{Robot, Spec, Step, design, export};
use synthesis::tuner::{Flow, Phase, Progress, TuneError};

use crate::line::Line;
use capture::flight::find;
use capture::provenance::{digest, plant_digest};
pub(super) use lookup::{look_up, recall};
use matrices::tune_matrices;
use print::print;
pub(super) use print::print_validation;
pub(super) use sliding::{sliding_gain, take_sliding_gain};
pub(super) use verify::{channel_entries, contradictions, optima, sampled_entries, stated_margins, validation_entry};

/// Exit code: no stabilising gain was found, or the run broke down.
const FAILED: i32 = 1;
/// Exit code: the specification is wrong.
const REFUSED: i32 = 2;
/// Exit code: gains were found, but the verification contradicts them or the validation set does not pass.
const NOT_MET: i32 = 3;

/// Tune gains by structured H-infinity and verify them.
///
/// SPEC is a specification of the robot's velocity loop (`.toml`, see `gains/*.spec.toml`), or a plant as plain matrices
/// (`.json` with the keys A, B1, B, C1, C, D11, D12, D21, and optionally D22 and K), for which a static output feedback
/// u = K y is tuned.
///
/// Ctrl-C ends the search and keeps the best gains so far; a second one ends the program.
///
/// Exit code 0: tuned and verified. 1: no stabilising gain found. 2: the specification is wrong. 3: the verification or the
/// validation set is not passed, or gamma falls without end as gains grow or a pole nears the axis.
#[derive(Debug, Args)]
pub struct TuneArgs {
    /// The specification
    pub spec: PathBuf,
    /// Where to write the gains; next to the specification when not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Take the configuration of the model from a recorded run, or from a scenario that is flown for it, at this instant;
    /// MODEL= may be left out where there is one model. The same as `at = "RUN:TIME"` of that model in the specification
    #[arg(long, value_name = "[MODEL=]RUN:TIME")]
    pub at: Vec<String>,
    /// Number of starts, in place of the specification's
    #[arg(long)]
    pub starts: Option<usize>,
    /// Seed of the search, in place of the specification's
    #[arg(long)]
    pub seed: Option<u64>,
    /// Write the generalised plant, the gains and what is claimed as plain matrices
    #[arg(long, value_name = "FILE.json")]
    pub export_problem: Option<PathBuf>,
    /// Write singular values against weights, sensitivity and mu as SVG into this folder
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Go on with links of the robot that no distribution of mass has; they are warned of
    #[arg(long)]
    pub allow_unphysical: bool,
    /// Leave out the margins
    #[arg(long)]
    pub no_margins: bool,
    /// Leave out the flights in the non-linear simulator
    #[arg(long)]
    pub no_flights: bool,
    /// Print one line for a table of several designs: gamma, full-order optimum, margins
    #[arg(long)]
    pub table: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Tunes, verifies, writes; gives the exit code.
pub fn run(args: &TuneArgs) -> anyhow::Result<i32> {
    let text = match std::fs::read_to_string(&args.spec) {
        Ok(text) => text,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    let stop = Arc::new(AtomicBool::new(false));
    // The second Ctrl-C finds the flag set and ends the program; the order of these two lines makes it so.
    signal_hook::flag::register_conditional_shutdown(signal_hook::consts::SIGINT, 130, Arc::clone(&stop))?;
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::clone(&stop))?;
    if args.spec.extension().is_some_and(|e| e == "json") {
        tune_matrices(args, &text, &stop)
    } else {
        tune_robot(args, &text, &stop)
    }
}

/// Says on standard error how far the work is, and passes on a request for its end.
pub(in crate::commands) struct Reporter<'a> {
    stop: &'a AtomicBool,
    line: Mutex<Line>,
    started: Instant,
}

impl<'a> Reporter<'a> {
    pub(in crate::commands) fn new(stop: &'a AtomicBool) -> Reporter<'a> {
        Reporter {
            stop,
            line: Mutex::new(Line::new(false)),
            started: Instant::now(),
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says what `text` says, if it is time.
    fn say(&self, text: impl FnOnce() -> String) -> Flow {
        self.line()
            .show(|| format!("{}, {:.0} s so far", text(), self.started.elapsed().as_secs_f64()));
        if self.stop.load(Ordering::Relaxed) {
            Flow::Stop
        } else {
            Flow::Continue
        }
    }

    /// Whether to stop before `what` number `done` of `all`, which is said.
    pub(in crate::commands) fn next(&self, what: &str, done: usize, all: usize) -> bool {
        self.say(|| format!("{what} {} of {all}", done + 1)) == Flow::Stop
    }

    /// The work that was reported is over.
    pub(in crate::commands) fn over(&self) {
        self.line().clear();
    }
}

fn progress_line(p: Progress, starts: usize) -> String {
    let (start, value) = (p.start + 1, p.value);
    match p.phase {
        Phase::Stabilise => format!("start {start} of {starts}: stabilising, spectral abscissa {value:.4e}"),
        Phase::Descend => format!("start {start} of {starts}: descending, gamma {value:.5}"),
        Phase::Finish => format!("start {start} of {starts}: finishing, gamma {value:.5}"),
    }
}

/// The exit code for a tuner that gave no gains.
fn failure(error: &TuneError) -> i32 {
    match error {
        TuneError::NotStabilised { .. } | TuneError::Stopped(_) | TuneError::Linalg(_) => FAILED,
        _ => REFUSED,
    }
}

fn tune_robot(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
    let loaded = load(&args.spec, text, args.allow_unphysical).and_then(|(mut spec, robot, urdf)| {
        lookup::override_with(&mut spec, &args.at)?;
        look_up(&args.spec, &mut spec)?;
        let proportional = sliding_gain(&args.spec, &spec, &urdf)?;
        anyhow::Ok((spec, robot, urdf, proportional))
    });
    let (mut spec, robot, urdf, proportional) = match loaded {
        Ok(loaded) => loaded,
        Err(error) => {
            eprintln!("error: {}: {error:#}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    spec.search.starts = args.starts.unwrap_or(spec.search.starts);
    spec.search.seed = args.seed.unwrap_or(spec.search.seed);
    let reporter = Reporter::new(stop);
    let clock = Instant::now();
    let design = match design(&spec, &robot, threads(), &|step| {
        reporter.say(|| match step {
            Step::Tune(p) => progress_line(p, spec.search.starts),
            Step::Validate(done) => format!("validating: {done} of {}", spec.validation.samples),
            Step::Adversary(gamma) => format!("the adversary adds a situation with gamma {gamma:.3}"),
        })
    }) {
        Ok(design) => design,
        Err(error) => {
            reporter.over();
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(match &error {
                synthesis::robot::ValidateError::Tune(error) => failure(error),
                synthesis::robot::ValidateError::Robot(_) => REFUSED,
            });
        }
    };
    reporter.over();
    let tuning = clock.elapsed().as_secs_f64();
    if let Some(path) = &args.export_problem {
        let d = &design;
        let exported = export(
            &d.problem,
            &d.tuned.gains,
            &d.tuned.controllers,
            &d.tuned.evaluation,
            Some(&d.tuned.certificate),
        );
        write(path, &serde_json::to_string(&exported)?)?;
    }
    let (mut file, mut complaints) = verify::verify(args, &spec, &robot, &design, &reporter)?;
    file.provenance.specification = args.spec.display().to_string();
    file.provenance.specification_digest = digest(text);
    file.provenance.plant_digest = plant_digest(&urdf).unwrap_or_default();
    if let Some(proportional) = &proportional {
        take_sliding_gain(&mut file, &spec, proportional);
    }
    if design.tuned.stopped {
        complaints.push("the search was stopped before it was done".into());
    }
    let path = args.out.clone().unwrap_or_else(|| gains_path(&args.spec));
    write(&path, &toml::to_string(&file)?)?;
    print(args, &spec, &file, tuning)?;
    for complaint in &complaints {
        eprintln!("not met: {complaint}");
    }
    eprintln!("gains written to {}", path.display());
    Ok(if complaints.is_empty() { 0 } else { NOT_MET })
}

/// Reads a specification and the robot it names. The description's path is taken from the working directory, from the
/// folder of the specification, or from the folder above it, whichever has it.
pub(super) fn load(path: &Path, text: &str, allow_unphysical: bool) -> anyhow::Result<(Spec, Robot, String)> {
    let spec: Spec = toml::from_str(text)?;
    let Some(found) = find(path, &spec.robot.urdf) else {
        bail!(
            "robot.urdf = {:?}: no such file here, beside the specification, or above it",
            spec.robot.urdf
        )
    };
    let urdf = std::fs::read_to_string(&found).with_context(|| found.display().to_string())?;
    let robot = Robot::from_description(super::model::read(&found, allow_unphysical)?, &spec.robot)?;
    spec.check(robot.channels())?;
    Ok((spec, robot, urdf))
}

/// How many threads to use.
pub(super) fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// `x.spec.toml` becomes `x.toml`; anything else gets `.gains.toml`, so that a specification is never overwritten.
fn gains_path(spec: &Path) -> PathBuf {
    let name = spec
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    match name.strip_suffix(".spec.toml") {
        Some(stem) => spec.with_file_name(format!("{stem}.toml")),
        None => spec.with_extension("gains.toml"),
    }
}

pub(super) fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::write(path, text).with_context(|| path.display().to_string())
}
