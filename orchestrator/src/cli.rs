//! The command line.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{ArgPredicate, PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory, Parser, Subcommand};
use lockstep::time::{Rational, TimeError};

use crate::commands::compare::CompareArgs;
use crate::commands::completions::CompletionsArgs;
use crate::commands::export::ExportArgs;
use crate::commands::faults::FaultsArgs;
use crate::commands::fmu::FmuArgs;
use crate::commands::man::ManArgs;
#[cfg(feature = "capture")]
use crate::commands::margins::MarginsArgs;
use crate::commands::measure::MeasureArgs;
use crate::commands::new::NewArgs;
use crate::commands::replay::ReplayArgs;
use crate::commands::report::ReportArgs;
use crate::commands::shards::SweepCommand;
#[cfg(feature = "capture")]
use crate::commands::tune::TuneArgs;
use engine::run::{self, Known, Overrun, RunFailure, Wait};
use engine::scenario::{Program, Scenario};

/// Co-simulation in lockstep over shared memory.
///
/// A scenario file says who takes part, at which rate, and who reads whom; `run` runs it and leaves a folder with everything
/// that is known of the run. `COMMAND --help` has all options of a command.
///
/// Exit codes: 0 all went well, and every criterion is met; 1 the run failed or was stopped; 2 the scenario or the command line is wrong,
/// nothing was run; 3 the run ended but a criterion is not met, or what was compared differs.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
pub struct Cli {
    /// What to do
    #[command(subcommand)]
    pub command: Command,
}

/// The command line, in which a point of a campaign may stand in the place of a scenario to run.
pub fn command() -> clap::Command {
    Cli::command().mut_subcommand("run", |run| {
        run.mut_arg("scenario", |scenario| {
            let instead = ArgPredicate::IsPresent;
            scenario
                .required(false)
                .required_unless_present("point")
                .default_value_if("point", instead, Some("-"))
        })
    })
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a project to start from
    New(NewArgs),
    /// Run a scenario
    Run(RunArgs),
    /// Go on with a run from one of its checkpoints, also with changes
    Resume(ResumeArgs),
    /// Everything but the launch: read, plan, and say what would run
    Check(CheckArgs),
    /// Draw participants, rates, delays and order
    Graph(GraphArgs),
    /// Run a scenario over a grid of values: one table, and a picture of where it works
    Sweep(SweepCommand),
    /// Run a scenario with one failure after the other, and say which still meet the criteria
    Faults(FaultsArgs),
    /// Say whether two tapes are identical, else where they differ
    Compare(CompareArgs),
    /// Ask the tape of a run for figures: of a field, or the measures of a scenario
    Measure(MeasureArgs),
    /// Run one participant of a recorded run again and compare what it says with the tape
    Replay(ReplayArgs),
    /// Write a page with figures, summary and 3-D playback of one run or several side by side
    Report(ReportArgs),
    /// Write the tape of a run as CSV, Parquet, MCAP or a Rerun recording
    Export(ExportArgs),
    /// Look at this machine, and at what dead runs left behind
    Doctor(DoctorArgs),
    /// Print a model's tree, or everything about given states, to compare with another engine
    #[cfg(feature = "capture")]
    Model(ModelArgs),
    /// Tune gains by structured H-infinity
    #[cfg(feature = "capture")]
    Tune(TuneArgs),
    /// Verify gains: norms, mu, margins, the sampled loop
    #[cfg(feature = "capture")]
    Margins(MarginsArgs),
    /// Look at an FMU before it takes part
    Fmu(FmuArgs),
    /// Measure what lockstep costs on this machine
    Bench(BenchArgs),
    /// Print a script that completes commands and options in a shell
    Completions(CompletionsArgs),
    /// Print the manual page, or write one for each command
    Man(ManArgs),
    /// Be a participant of a run (started by the orchestrator itself)
    #[command(hide = true)]
    Participant(ParticipantArgs),
    /// Run points of a campaign (started by the orchestrator itself)
    #[command(hide = true)]
    CampaignWorker,
}

/// A scenario with changes.
#[derive(Debug, Args)]
pub struct ScenarioArgs {
    /// The scenario file
    pub scenario: PathBuf,
    /// Change a key of the scenario, such as connections.measured.delay=10ms (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Another program in a participant's place from the start: a file, or builtin:NAME (may be given more than once)
    #[arg(long, value_name = "PARTICIPANT=PROGRAM", value_parser = substitute)]
    pub substitute: Vec<String>,
    /// Add a fault, such as at=12s,until=14s,input=controller.measured,field=q_m[3],kind=bias,value=0.2deg (may be given
    /// more than once; docs/scenarios.md has the keys)
    #[arg(long = "fault", value_name = "KEY=VALUE,…")]
    pub fault: Vec<String>,
    /// The seed of every random stream, in place of the scenario's
    #[arg(long)]
    pub seed: Option<u64>,
    /// How long to simulate, in place of the scenario's, such as 5s
    #[arg(long, value_parser = span)]
    pub duration: Option<Rational>,
}

/// `--wait` by the names of the strategies.
fn wait() -> impl TypedValueParser<Value = Wait> {
    PossibleValuesParser::new(Wait::ALL.map(|(name, _)| name)).map(|text| {
        let found = Wait::ALL.iter().find(|(name, _)| *name == text);
        found.map(|(_, wait)| *wait).unwrap_or_default()
    })
}

/// `--overrun` by its words.
fn overrun() -> impl TypedValueParser<Value = Overrun> {
    PossibleValuesParser::new(Overrun::ALL.map(|(name, _)| name)).map(|text| {
        let found = Overrun::ALL.iter().find(|(name, _)| *name == text);
        found.map(|(_, overrun)| *overrun).unwrap_or_default()
    })
}

/// `--substitute` as an override.
fn substitute(text: &str) -> Result<String, String> {
    let (participant, run) = engine::shadow::in_place(text, "--substitute")?;
    Ok(format!("participants.{participant}.run={run}"))
}

/// An instant of a run, for an option.
pub fn instant(text: &str) -> Result<Rational, String> {
    let time: Rational = text.parse().map_err(|error: TimeError| error.to_string())?;
    if time.is_negative() {
        return Err(format!(
            "{time} lies before the start; write 0 s or a later time, such as 5s"
        ));
    }
    Ok(time)
}

/// A stretch of time, for an option.
pub fn span(text: &str) -> Result<Rational, String> {
    let time: Rational = text.parse().map_err(|error: TimeError| error.to_string())?;
    if !time.is_positive() {
        return Err(format!("{time} is not above zero; write a time such as 5s"));
    }
    Ok(time)
}

/// Slower or faster is not meant: a run would stand still, or its clock would have no effect.
const PACES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// A multiple of the wall clock's pace, for an option.
fn pace(text: &str) -> Result<f64, String> {
    let factor: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if !PACES.contains(&factor) {
        return Err(format!(
            "{factor} is not a pace; write a factor from {} to {}, such as 2",
            PACES.start(),
            PACES.end()
        ));
    }
    Ok(factor)
}

impl CommonArgs {
    /// `--start-within` as far as a duration goes.
    pub fn start_within(&self) -> Option<Duration> {
        let time = self.start_within?;
        Some(Duration::try_from_secs_f64(time.seconds()).unwrap_or(Duration::ZERO))
    }

    /// Refuses to replace the run in `source`, from which this one is made.
    ///
    /// # Errors
    /// Names the folder and the remedy.
    pub fn spares(&self, source: &Path) -> Result<(), String> {
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
    /// All changes in the form that [`engine::scenario::Scenario::read`] takes.
    pub fn overrides(&self) -> Vec<String> {
        let mut all = self.substitute.clone();
        all.extend_from_slice(&self.set);
        all.extend(self.fault.iter().map(|fault| format!("faults+={fault}")));
        all.extend(self.seed.map(|seed| format!("seed={seed}")));
        all.extend(self.duration.map(|duration| format!("duration={duration}")));
        all
    }
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Run this point of a campaign by itself, whole tape and all, in place of a scenario: the same digest
    #[arg(long, value_name = "FOLDER:NUMBER", conflicts_with_all = ["scenario", "shadow"])]
    pub point: Option<PathBuf>,
    /// Feed a second program what a participant is fed, and say where it would have said something else: a file, or
    /// builtin:NAME (may be given more than once)
    #[arg(long, value_name = "PARTICIPANT=PROGRAM")]
    pub shadow: Vec<String>,
    /// Change a parameter of the shadows, such as law=\"reference\" (may be given more than once)
    #[arg(long, value_name = "KEY.PATH=VALUE", requires = "shadow")]
    pub shadow_set: Vec<String>,
    /// How to run it
    #[command(flatten)]
    pub how: HowArgs,
}

/// Arguments of `resume`.
#[derive(Debug, Args)]
pub struct ResumeArgs {
    /// The folder of the run to go on from
    pub run: PathBuf,
    /// Go on from the newest checkpoint at or before this simulated time, and make the changes at this time; from the newest of all when
    /// not given
    #[arg(long, value_name = "TIME", value_parser = instant)]
    pub from: Option<Rational>,
    /// Change a key of the scenario from here on, to ask what if (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// How long to simulate in all, in place of what the run had
    #[arg(long, value_parser = span)]
    pub duration: Option<Rational>,
    /// How to run it
    #[command(flatten)]
    pub how: HowArgs,
}

/// How to run a scenario, whatever it is.
#[derive(Debug, Args)]
pub struct HowArgs {
    /// All participants in this process, in one loop: the same tape to the last bit
    #[arg(long)]
    pub in_process: bool,
    /// What every run takes
    #[command(flatten)]
    pub common: CommonArgs,
    /// Keep pace with the wall clock, or with a multiple of it
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, default_missing_value = "1", require_equals = true, value_parser = pace)]
    pub real_time: Option<f64>,
    /// With --real-time: what becomes of the run when a step is complete only after the next one was due: it is counted, or the run ends
    #[arg(long, value_name = "WHAT", default_value = "report", value_parser = overrun(), requires = "real_time")]
    pub overrun: Overrun,
    /// Write what every participant did when (steps, waits, cores) as a trace that Perfetto opens; no more than a million spans
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Come to rest at this simulated time and wait for Enter (may be given more than once)
    #[arg(long, value_name = "TIME", value_parser = instant)]
    pub pause_at: Vec<Rational>,
    /// Show the run on a page while it goes on, with pause, step and resume; the address is printed. Takes a port, else any
    /// that is free
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", require_equals = true)]
    pub live: Option<u16>,
    /// Keep serving the page after the end of the run, until Ctrl-C (implies --live)
    #[arg(long)]
    pub live_stay: bool,
    /// Keep the state of the run in a file this often (simulated time), for `resume`
    #[arg(long, value_name = "TIME", value_parser = span)]
    pub checkpoint_every: Option<Rational>,
    /// Keep the state of the run in a file at this simulated time (may be given more than once)
    #[arg(long, value_name = "TIME", value_parser = instant)]
    pub checkpoint_at: Vec<Rational>,
    /// How participants wait for each other; the result does not depend on it. Spinning is granted where each has a core
    #[arg(long, default_value = "auto", value_parser = wait())]
    pub wait: Wait,
    /// Leave the choice of cores to the operating system
    #[arg(long)]
    pub no_placement: bool,
}

/// What `run`, `resume` and `replay` have in common.
#[derive(Debug, Args)]
pub struct CommonArgs {
    /// The run folder; a new one under runs/ when not given, and none for a replay
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Replace the run in the run folder, if there is one: only ever a run, once the new one has begun
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// No progress line, and no result but the exit code
    #[arg(long)]
    pub quiet: bool,
    /// Give up when nothing has moved for this long, without the time in which the orchestrator itself was stopped; not used
    /// while a replay waits for a debugger
    #[arg(long, value_name = "TIME", default_value = "60 s", value_parser = span)]
    pub patience: Rational,
    /// How long each program may take to enter the run and to answer a request, in place of what the scenario says (20 s
    /// where it says nothing)
    #[arg(long, value_name = "TIME", value_parser = span)]
    pub start_within: Option<Rational>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Which programs to ask
    #[command(flatten)]
    pub start: StartArgs,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Whether programs are started to be asked for their ports.
#[derive(Debug, Args)]
pub struct StartArgs {
    /// Start participants that are programs of their own, to ask for their ports: what is not asked is unknown
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
    /// Up to sixteen of them: that is done in a moment.
    Auto,
    /// However many there are.
    Always,
    /// None.
    Never,
}

impl StartArgs {
    /// What is known of `scenario` without a run of it.
    ///
    /// # Errors
    /// What a run of it would be refused for.
    pub fn check(&self, scenario: &Scenario) -> Result<Known, RunFailure> {
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

/// Arguments of `graph`.
#[derive(Debug, Args)]
pub struct GraphArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Which programs to ask
    #[command(flatten)]
    pub start: StartArgs,
    /// The language of the drawing
    #[arg(long, value_enum, default_value_t)]
    pub format: GraphFormat,
}

/// A drawing's language.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum GraphFormat {
    /// Mermaid, for Markdown pages
    #[default]
    Mermaid,
    /// DOT, for Graphviz
    Dot,
}

/// Arguments of `doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Remove what dead runs left behind
    #[arg(long)]
    pub remove: bool,
    /// Print the findings as JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `participant`.
#[derive(Debug, Args)]
pub struct ParticipantArgs {
    /// Which one; of a library with one participant it may be left out
    #[arg(required_unless_present_any = ["library", "fmu"])]
    pub name: Option<String>,
    /// A plug-in that contains it
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
    /// An FMU in its place
    #[arg(long, value_name = "FILE")]
    pub fmu: Option<PathBuf>,
    /// The keys beside the FMU, as TOML
    #[arg(long, default_value = "", requires = "fmu")]
    pub options: String,
}

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Measure this scenario too, such as scenarios/close.toml
    pub scenario: Option<PathBuf>,
    /// How often each is measured
    #[arg(long, default_value_t = 11)]
    pub rounds: usize,
    /// The largest ring
    #[arg(long, default_value_t = 64)]
    pub participants: usize,
    /// How many participants are killed to see how soon that is known
    #[arg(long, default_value_t = 100)]
    pub deaths: usize,
}

/// Arguments of `model`.
#[cfg(feature = "capture")]
#[derive(Debug, Args)]
pub struct ModelArgs {
    /// The model, a URDF file
    pub model: PathBuf,
    /// States in JSON; without them the tree is printed
    pub states: Option<PathBuf>,
    /// Go on with links that no distribution of mass has; they are warned of
    #[arg(long)]
    pub allow_unphysical: bool,
}
