//! The command line.

use clap::builder::ArgPredicate;
use clap::{CommandFactory, Parser, Subcommand};

use crate::commands::bench::BenchArgs;
use crate::commands::check::CheckArgs;
use crate::commands::compare::CompareArgs;
use crate::commands::completions::CompletionsArgs;
use crate::commands::doctor::DoctorArgs;
use crate::commands::export::ExportArgs;
use crate::commands::faults::FaultsArgs;
use crate::commands::fmu::FmuArgs;
use crate::commands::graph::GraphArgs;
use crate::commands::import::ImportArgs;
use crate::commands::man::ManArgs;
#[cfg(feature = "capture")]
use crate::commands::margins::MarginsArgs;
use crate::commands::measure::MeasureArgs;
#[cfg(feature = "capture")]
use crate::commands::model::ModelArgs;
use crate::commands::new::NewArgs;
use crate::commands::participant::ParticipantArgs;
use crate::commands::replay::ReplayArgs;
use crate::commands::report::ReportArgs;
use crate::commands::resume::ResumeArgs;
use crate::commands::run::RunArgs;
use crate::commands::shards::SweepCommand;
#[cfg(feature = "capture")]
use crate::commands::tune::TuneArgs;

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
    /// Write the tape of a run as CSV, Parquet, MAT, MCAP or a Rerun recording
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
    /// Make a scenario of a system structure (SSP)
    Import(ImportArgs),
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
