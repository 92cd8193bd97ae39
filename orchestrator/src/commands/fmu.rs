//! `escapement fmu`: FMUs before they take part, and the process of one that does.

use std::path::Path;
use std::process::ExitCode;

use crate::cli::{FmuAction, FmuArgs};

/// Looks at an FMU.
pub fn run(args: &FmuArgs) -> anyhow::Result<i32> {
    match &args.action {
        FmuAction::Inspect { file } => {
            let found = fmu::inspect(file)?;
            print!("{}", found.text);
            println!("\nA scenario with it:\n\n{}", found.scenario);
            Ok(if found.usable { 0 } else { 2 })
        }
    }
}

/// An FMU as a participant in this process, which is its own: what it writes into its log is kept with the run, and it works in a
/// folder that goes when it ends.
pub fn host(file: &Path, options: &str) -> ExitCode {
    fmu::to_standard_error();
    let (file, options) = (file.to_owned(), options.to_owned());
    let version = concat!("fmu ", env!("CARGO_PKG_VERSION"));
    lockstep::host::run(move |setup| fmu::participant(&file, &options, setup, true), version)
}
