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
/// A scenario file declares the participants, their rates and the connections between them; `run` runs it and writes a folder
/// with all results of the run. `COMMAND --help` lists all options of a command.
///
/// Exit codes: 0 success, and every criterion is met; 1 the run failed or was stopped; 2 the scenario or the command line is wrong,
/// nothing was run; 3 the run is complete but a criterion is not met, or what was compared differs.
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
    /// Write a starter project into a new folder
    ///
    /// The template determines whether the project has scenarios only, models, or a program of your own. The folder is created; an existing folder
    /// must be empty. The command lists the files that it has written and the next steps.
    New(NewArgs),
    /// Run a scenario
    ///
    /// Exit codes: 0 the run is complete, and every criterion is met; 1 the run failed or was stopped; 2 the scenario or the command line is wrong,
    /// nothing was run; 3 the run is complete but a criterion is not met.
    Run(RunArgs),
    /// Continue a run from one of its checkpoints, optionally with changes
    ///
    /// Checkpoints are written by `run --checkpoint-every` and `run --checkpoint-at`. The continued run has a folder of its own; the folder of the
    /// first one is not changed. Without changes its tape is identical to that of a run without interruption. The exit codes are those of `run`.
    Resume(ResumeArgs),
    /// Do everything except the run: read the scenario, compute the plan, and print it
    ///
    /// Exit codes: 0 the scenario can be run; 1 a program that was queried for its ports failed; 2 the scenario or the command line is wrong.
    Check(CheckArgs),
    /// Draw participants, rates, delays and the order of execution
    Graph(GraphArgs),
    /// Run a scenario over a grid of values: one table, a chart of where the criteria are met, and a report
    ///
    /// Instead of a scenario the command takes a campaign file, which names a scenario and declares how its keys are dispersed (docs/campaigns.md).
    ///
    /// Values are a list (5ms,10ms), a range including both ends (0ms..200ms:10ms), integers (seed=1..100) or texts
    /// (participants.controller.parameters.law=hierarchical,reference). Several --vary give all combinations.
    ///
    /// Each point runs in a worker process without a tape. A point that is rejected, fails or crashes is a row of the table with the reason. The
    /// table does not depend on the number of workers. The same command continues an interrupted sweep.
    ///
    /// Exit codes: 0 all points ran, whether their criteria are met or not; 1 a point did not run to its end, or the sweep was stopped; 2 the
    /// scenario, the grid or the folder is wrong, nothing was run.
    Sweep(SweepCommand),
    /// Run a scenario with one failure after the other, and report which runs still meet the criteria
    ///
    /// With --cases the failures are those of a file: a list of [[case]], each with a name and its changes (docs/campaigns.md). Without it they are
    /// all single failures of the actuators of the stock plant.
    ///
    /// Exit codes: 0 all points ran, whether their criteria are met or not; 1 a point did not run to its end, or the campaign was stopped; 2 the
    /// scenario, the list or the folder is wrong, nothing was run.
    Faults(FaultsArgs),
    /// Report whether two tapes are identical, and if not, the first difference and the largest of each field
    ///
    /// Exit codes: 0 identical; 3 different; 2 one of the two tapes cannot be read.
    Compare(CompareArgs),
    /// Compute figures from the tape of a run: of a field, or the measures of a scenario
    ///
    /// With --of and --compute the command computes one figure; the options are the keys of a table [measures.NAME] (docs/scenarios.md). With
    /// --measures it computes every measure that another scenario file declares, and with neither those of the run's own scenario.
    ///
    /// Exit codes: 0 every criterion is met, or there is none; 3 a criterion is not met; 2 the command line does not fit the tape, or the tape cannot be
    /// read.
    Measure(MeasureArgs),
    /// Run one participant of a recorded run again, and compare its outputs with the tape
    ///
    /// The participant receives the inputs that it had in the run. The replay starts at the beginning of the run, because only there the state of
    /// the participant is known.
    ///
    /// Exit codes: 0 identical; 3 different; 2 the participant or the tape does not fit, or no sample could be compared; 1 the participant failed.
    Replay(ReplayArgs),
    /// Write a page with figures, summary and 3-D playback of one run, or of several runs overlaid
    ///
    /// The page is one HTML file that needs no network and no other file. It has a figure for every field of every stream, and before them those
    /// that the scenario selects in its table [report].
    Report(ReportArgs),
    /// Write the tape of a run as CSV, Parquet, MAT, MCAP or a Rerun recording
    Export(ExportArgs),
    /// Check this machine, and find what killed runs left behind
    Doctor(DoctorArgs),
    /// Print a model's tree, or all quantities at given states, to compare with another engine
    #[cfg(feature = "capture")]
    Model(ModelArgs),
    /// Tune gains by structured H-infinity, and verify them
    ///
    /// SPEC is a specification of the robot's velocity loop (`.toml`, see `gains/*.spec.toml`), or a plant as plain matrices (`.json` with the keys
    /// A, B1, B, C1, C, D11, D12, D21, and optionally D22 and K), for which a static output feedback u = K y is tuned.
    ///
    /// Ctrl-C ends the search and keeps the best gains so far; a second Ctrl-C ends the program.
    ///
    /// Exit codes: 0 tuned and verified; 1 no stabilising gain was found; 2 the specification is wrong; 3 the verification or the validation set is
    /// not passed, or gamma decreases without limit as gains grow or a pole approaches the imaginary axis.
    #[cfg(feature = "capture")]
    Tune(TuneArgs),
    /// Verify gains: norms, mu, margins, the sampled loop
    ///
    /// Margins are multiples of the stated uncertainty: 1.5 means that the loop stays stable for every error up to 1.5 times the set. The first
    /// number is guaranteed for all frequencies, the second is the size of an error that destabilises the loop.
    ///
    /// Exit codes: 0 the gamma of the file is reproduced, every sampled loop is stable, and no closed-loop run contradicts this; 2 a file is missing
    /// or wrong; 3 otherwise.
    #[cfg(feature = "capture")]
    Margins(MarginsArgs),
    /// Inspect an FMU, or export one
    Fmu(FmuArgs),
    /// Create a scenario from a system structure (SSP 1.0 or 2.0): a folder with the scenario and its FMUs
    ///
    /// Nested systems are flattened, and parameters are filled in. What a scenario cannot express is rejected with file and line. No code of an FMU
    /// is executed.
    Import(ImportArgs),
    /// Measure the overhead of lockstep on this machine
    Bench(BenchArgs),
    /// Print a script that completes commands, options and files in a shell
    ///
    /// bash: `escapement completions bash > ~/.local/share/bash-completion/completions/escapement`.
    ///
    /// zsh: `escapement completions zsh > FOLDER/_escapement`, with a folder of `$fpath`.
    ///
    /// fish: `escapement completions fish > ~/.config/fish/completions/escapement.fish`.
    Completions(CompletionsArgs),
    /// Print the manual page, or write one page for each command into a folder
    ///
    /// `escapement man | man -l -` shows the page. `escapement man ~/.local/share/man/man1` installs all pages: `man escapement`,
    /// `man escapement-run` and so on.
    Man(ManArgs),
    /// Be a participant of a run (started by the orchestrator itself)
    #[command(hide = true)]
    Participant(ParticipantArgs),
    /// Run points of a campaign (started by the orchestrator itself)
    #[command(hide = true)]
    CampaignWorker,
}
