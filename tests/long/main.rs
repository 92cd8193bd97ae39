//! The long tests: `long killer`, `long starts`, `long suspensions`.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use escapement_tests::long::RoundKind;
use escapement_tests::long::work::{Report, Work};

/// Random signals, undisturbed starts and suspensions, as many rounds as asked for
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    kind: Command,

    /// What the draws of all rounds depend on
    #[arg(long, default_value_t = 1, global = true)]
    seed: u64,

    /// The number of the first round
    #[arg(long, default_value_t = 0, global = true)]
    first: u64,

    /// How many rounds
    #[arg(long, default_value_t = 200, global = true)]
    rounds: u64,

    /// How many of them side by side
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..), global = true)]
    jobs: u64,

    /// Keep all processors busy with something else
    #[arg(long, global = true)]
    beside_load: bool,

    /// Do the part of a worker
    #[arg(long, hide = true, global = true)]
    share: Option<u64>,
}

#[derive(Subcommand)]
enum Command {
    /// Signals at random instants, start and end included, to participants, orchestrator and campaigns; what was saved is resumed
    Killer,
    /// Short runs that nothing disturbs
    Starts,
    /// Stops and continuations, shorter and longer than the patience
    Suspensions,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let work = Work {
        kind: match arguments.kind {
            Command::Killer => RoundKind::Killer,
            Command::Starts => RoundKind::Starts,
            Command::Suspensions => RoundKind::Suspensions,
        },
        seed: arguments.seed,
        first: arguments.first,
        rounds: arguments.rounds,
        jobs: arguments.jobs,
        beside_load: arguments.beside_load,
    };
    if let Some(share) = arguments.share {
        work.run_share(share);
        return ExitCode::SUCCESS;
    }
    let mut reported = 0;
    let report = work.run(|report| {
        for failure in &report.failures[reported..] {
            eprintln!("{failure}");
        }
        reported = report.failures.len();
        eprintln!("{}", line(report));
    });
    for failure in &report.failures[reported..] {
        eprintln!("{failure}");
    }
    println!("{}", line(&report));
    if report.failures.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn line(report: &Report) -> String {
    let tally = &report.tally;
    format!(
        "{} rounds: {} runs, {} signals, {} resumes, {} failures",
        report.rounds,
        tally.runs,
        tally.signals,
        tally.resumes,
        report.failures.len()
    )
}
