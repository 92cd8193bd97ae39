//! `escapement fmu`: inspection of FMUs, the process of an FMU in a run, and export of this program's contents as FMUs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::fmu_export::{self, FmuExportArgs};
use crate::refusal::Refusal;

/// Arguments of `fmu`.
#[derive(Debug, Args)]
pub struct FmuArgs {
    /// What to do
    #[command(subcommand)]
    pub action: FmuAction,
}

/// What `fmu` does.
#[derive(Debug, Subcommand)]
pub enum FmuAction {
    /// Describe an FMU: its ports with units, its parameters, its capabilities, and a scenario with it. No code of it is executed
    Inspect {
        /// The FMU
        file: PathBuf,
    },
    /// Create an FMU of a participant or of a whole scenario: self-contained, for co-simulation in any tool
    Export(FmuExportArgs),
}

/// Inspects an FMU, or exports one.
pub fn run(args: &FmuArgs) -> anyhow::Result<i32> {
    match &args.action {
        FmuAction::Inspect { file } => {
            let found = fmu::inspect(file).map_err(Refusal::of)?;
            print!("{}", found.text);
            println!("\nA scenario with it:\n\n{}", found.scenario);
            Ok(if found.usable { 0 } else { 2 })
        }
        FmuAction::Export(args) => fmu_export::run(args),
    }
}

/// An FMU as the only participant of this process: its log is kept with the run, and its working directory is removed when
/// the process ends.
pub fn host(file: &Path, options: &str) -> ExitCode {
    fmu::to_standard_error();
    let (file, options) = (file.to_owned(), options.to_owned());
    let version = concat!("fmu ", env!("CARGO_PKG_VERSION"));
    lockstep::host::run(move |setup| fmu::participant(&file, &options, setup, true), version)
}
