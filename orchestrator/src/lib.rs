//! Escapement's program: scenario, plan, launch, clock, record, report.

#[cfg(target_arch = "x86_64")]
mod processor;

#[macro_use]
mod output;

mod bench;
mod builtin;
mod cli;
mod commands;
pub mod decoders;
mod limits;
mod signals;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};

/// The program.
pub fn main() -> ExitCode {
    #[cfg(target_arch = "x86_64")]
    if let Err(missing) = processor::check() {
        eprintln!("error: {missing}");
        return ExitCode::from(1);
    }
    let cli = Cli::parse();
    // A participant is its own program that happens to live in this file: it reports as one.
    if let Command::Participant(args) = &cli.command {
        return commands::participant::run(args);
    }
    limits::raise_open_files();
    let result = match &cli.command {
        Command::Run(args) => commands::run::run(args),
        Command::Resume(args) => commands::resume::run(args),
        Command::Check(args) => commands::check::run(args),
        Command::Graph(args) => commands::graph::run(args),
        Command::Compare(args) => commands::compare::run(args),
        Command::Replay(args) => commands::replay::run(args),
        Command::Report(args) => commands::report::run(args),
        Command::Export(args) => commands::export::run(args),
        Command::Model(args) => commands::model::run(args).map(|()| 0),
        Command::Tune(args) => commands::tune::run(args),
        Command::Margins(args) => commands::margins::run(args),
        Command::Sweep(args) => commands::sweep::run(args),
        Command::Faults(args) => commands::faults::run(args),
        Command::Bench(args) => commands::bench::run(args),
        Command::Doctor(args) => commands::doctor::run(args),
        Command::CampaignWorker => {
            engine::campaign::serve(builtin::catalogue(), std::io::stdin().lock(), std::io::stdout())
                .map(|()| 0)
                .map_err(Into::into)
        }
        Command::Participant(_) => Ok(0),
    };
    match result {
        Ok(code) => ExitCode::from(code as u8),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(1)
        }
    }
}
