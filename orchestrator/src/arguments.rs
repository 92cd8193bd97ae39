//! Arguments shared by several commands.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lockstep::time::{Rational, TimeError};

use engine::run::{self, CheckedScenario, Overrun, RunFailure, Wait};
use engine::scenario::{Changes, FaultSpec, Program, RunSpec, Scenario, Time};

use crate::destination;
use crate::refusal::Refusal;

/// A scenario with changes.
#[derive(Debug, Args)]
pub struct ScenarioArgs {
    /// The scenario file
    pub scenario: PathBuf,
    /// Change a key of the scenario, such as connections.measured.delay=10ms (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Substitute another program for a participant from the start: a file, or builtin:NAME (may be given more than once)
    #[arg(long, value_name = "PARTICIPANT=PROGRAM", value_parser = parse_substitute)]
    pub substitute: Vec<(String, RunSpec)>,
    /// Add a fault, such as at=12s,until=14s,input=controller.measured,field=q[3],kind=bias,value=0.2deg (may be given
    /// more than once; docs/scenarios.md has the keys)
    #[arg(long = "fault", value_name = "KEY=VALUE,…")]
    pub fault: Vec<FaultSpec>,
    /// The seed of every random stream, instead of that of the scenario
    #[arg(long)]
    pub seed: Option<u64>,
    /// The simulated duration, such as 5s, instead of that of the scenario
    #[arg(long, value_parser = parse_duration)]
    pub duration: Option<Rational>,
}

/// Parser of `--wait`: the names of the strategies.
fn wait_parser() -> impl TypedValueParser<Value = Wait> {
    PossibleValuesParser::new(Wait::ALL.map(|(name, _)| name)).map(|text| {
        let found = Wait::ALL.iter().find(|(name, _)| *name == text);
        found.map(|(_, wait)| *wait).unwrap_or_default()
    })
}

/// Parser of `--overrun`: the names of the policies.
fn overrun_parser() -> impl TypedValueParser<Value = Overrun> {
    PossibleValuesParser::new(Overrun::ALL.map(|(name, _)| name)).map(|text| {
        let found = Overrun::ALL.iter().find(|(name, _)| *name == text);
        found.map(|(_, overrun)| *overrun).unwrap_or_default()
    })
}

/// Parser of a participant's substitute.
fn parse_substitute(text: &str) -> Result<(String, RunSpec), String> {
    engine::shadow::in_place(text, "--substitute")
}

/// Parser of an instant of a run.
pub fn parse_instant(text: &str) -> Result<Rational, String> {
    let time: Rational = text.parse().map_err(|error: TimeError| error.to_string())?;
    if time.is_negative() {
        return Err(format!(
            "{time} is before the start; write 0 s or a later time, such as 5s"
        ));
    }
    Ok(time)
}

/// Parser of a body of a scene with the file of its model.
pub fn parse_model(text: &str) -> Result<(String, PathBuf), String> {
    let parts = text
        .split_once('=')
        .filter(|(body, file)| !body.is_empty() && !file.is_empty());
    let (body, file) = parts.ok_or("write the body and its file as BODY=URDF, such as cart=models/cart.urdf")?;
    Ok((body.to_owned(), PathBuf::from(file)))
}

/// Parser of a duration.
pub fn parse_duration(text: &str) -> Result<Rational, String> {
    let time: Rational = text.parse().map_err(|error: TimeError| error.to_string())?;
    if !time.is_positive() {
        return Err(format!("{time} is not above zero; write a time such as 5s"));
    }
    Ok(time)
}

/// Beyond these limits a run would stand still, or its clock would have no effect.
const PACE_RANGE: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Parser of a multiple of the wall clock's pace.
fn parse_pace(text: &str) -> Result<f64, String> {
    let factor: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if !PACE_RANGE.contains(&factor) {
        return Err(format!(
            "{factor} is not a pace; write a factor from {} to {}, such as 2",
            PACE_RANGE.start(),
            PACE_RANGE.end()
        ));
    }
    Ok(factor)
}

impl CommonArgs {
    /// The value of `--start-within`, limited to the range of a `Duration`.
    pub fn start_within(&self) -> Option<Duration> {
        let time = self.start_within?;
        Some(Duration::try_from_secs_f64(time.seconds()).unwrap_or(Duration::ZERO))
    }

    /// The value of `--patience`, s; by default that of the engine.
    pub fn patience_s(&self) -> f64 {
        let default = || run::Options::default().patience_s;
        self.patience.map_or_else(default, Rational::seconds)
    }

    /// The warning about `--patience` for a run in one process, where nothing can end a step that does not return.
    pub fn patience_in_process(&self) -> Option<String> {
        let patience = self.patience?;
        Some(format!(
            "--patience {patience} has no effect on a run in one process, where a step that does not come back cannot be ended: run its \
             participants in processes"
        ))
    }

    /// Checks that `--out --force` does not replace the run in `source`, from which this run is made.
    ///
    /// # Errors
    /// Names the folder and the remedy.
    pub fn check_does_not_replace(&self, source: &Path) -> Result<(), String> {
        let real = |path: &Path| std::fs::canonicalize(path).ok();
        let out = self.out.as_deref().filter(|_| self.force).and_then(real);
        match (out, real(source)) {
            (Some(out), Some(source)) if source.starts_with(&out) => Err(format!(
                "--out {}: it has the run that is read, which --force would take away; name another folder",
                out.display()
            )),
            _ => Ok(()),
        }
    }
}

impl ScenarioArgs {
    /// All changes of the scenario.
    pub fn changes(&self) -> Changes {
        Changes {
            substitutes: self.substitute.clone(),
            set: self.set.clone(),
            faults: self.fault.clone(),
            seed: self.seed,
            duration: self.duration.map(Time::from),
        }
    }
}

/// How to run a scenario, whatever it is.
#[derive(Debug, Args)]
pub struct ExecutionArgs {
    /// Run all participants in this process, in one loop: the tape is bit-identical
    #[arg(long)]
    pub in_process: bool,
    /// What every run takes
    #[command(flatten)]
    pub common: CommonArgs,
    /// Pace the run by the wall clock, or by a multiple of it: 2 is twice as fast
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, default_missing_value = "1", require_equals = true, value_parser = parse_pace)]
    pub real_time: Option<f64>,
    /// With --real-time: what happens when a step is complete only after the next one was due: it is counted and reported, or the run stops
    #[arg(long, value_name = "WHAT", default_value = "report", value_parser = overrun_parser(), requires = "real_time")]
    pub overrun: Overrun,
    /// Write a timeline of every participant (steps, waits, cores) as a trace for Perfetto, with at most a million spans
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Pause at this simulated time and wait for Enter (may be given more than once)
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub pause_at: Vec<Rational>,
    /// Show the run on a page during the run, with pause, step and resume; the address is printed. Takes a port; without one, a
    /// free port is chosen
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    pub live: Option<u16>,
    /// Keep serving the page after the end of the run, until Ctrl-C (implies --live)
    #[arg(long)]
    pub live_stay: bool,
    /// Save the state of the run at this interval of simulated time, for `resume`
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub checkpoint_every: Option<Rational>,
    /// Save the state of the run at this simulated time, for `resume` (may be given more than once)
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub checkpoint_at: Vec<Rational>,
    /// How participants wait for each other; the result does not depend on it. Spinning is granted only if each has a core of its own
    #[arg(long, default_value = "auto", value_parser = wait_parser())]
    pub wait: Wait,
    /// Leave the choice of cores to the operating system
    #[arg(long)]
    pub no_placement: bool,
}

/// What `run`, `resume` and `replay` have in common.
#[derive(Debug, Args)]
pub struct CommonArgs {
    /// The run folder; by default a new one under runs/, and none for a replay
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Replace the run in the run folder, if there is one, as soon as the new run has begun; a folder with other contents is never replaced
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Print no progress, no result and no warnings about the scenario; the exit code is the result
    #[arg(long)]
    pub quiet: bool,
    /// End the run when no participant has made progress for this long, wall-clock time (60 s by default); the time during which the
    /// orchestrator itself was suspended does not count. No effect in one process, where a step that does not return cannot be ended, and
    /// while a replay waits for a debugger
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub patience: Option<Rational>,
    /// How long each program may take to enter the run and to answer a request, instead of the value in the scenario (by
    /// default 20 s)
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub start_within: Option<Rational>,
}

impl ExecutionArgs {
    /// Checks that the trace is not written over a recorded run.
    ///
    /// # Errors
    /// The part of the run that its file would be.
    pub fn check_trace(&self) -> Result<(), Refusal> {
        let file = self.trace.as_deref();
        let run = self.common.out.as_deref();
        file.map_or(Ok(()), |file| destination::check_beside("--trace", file, run))
    }
}

/// Whether programs are started to be asked for their ports.
#[derive(Debug, Args)]
pub struct StartArgs {
    /// Which external programs to start in order to query their ports; the ports of the others are unknown
    #[arg(
        long,
        value_enum,
        value_name = "WHEN",
        num_args = 0..=1,
        require_equals = true,
        default_value = "auto",
        default_missing_value = "always"
    )]
    pub start: Start,
}

/// When programs are started to be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Start {
    /// All of them if there are at most sixteen.
    Auto,
    /// All of them.
    Always,
    /// None of them.
    Never,
}

impl StartArgs {
    /// The plan of `scenario`, and what its programs report, without a run.
    ///
    /// # Errors
    /// The reason for which a run would be rejected.
    pub fn check(&self, scenario: &Scenario) -> Result<CheckedScenario, RunFailure> {
        const CHEAP: usize = 16;
        let asked = |program: &&Program| !matches!(program, Program::Builtin(_) | Program::Fmu { .. });
        let programs = scenario.programs().filter(asked).count();
        match self.start {
            Start::Auto if programs > CHEAP => Ok(run::check(scenario)?),
            Start::Never => Ok(run::check(scenario)?),
            Start::Auto | Start::Always => {
                let options = run::Options {
                    interrupt: crate::signals::interrupt(),
                    ..run::Options::default()
                };
                run::check_with_programs(scenario, &options)
            }
        }
    }
}
