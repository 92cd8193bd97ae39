//! `escapement participant NAME`: a participant that this program or a library contains, in its own process.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use crate::catalogue::catalogue;

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

/// Runs the participant in the run that the environment names.
pub fn run(args: &ParticipantArgs) -> ExitCode {
    if let Some(library) = &args.library {
        return plugin::host_library(library, args.name.as_deref());
    }
    if let Some(file) = &args.fmu {
        return crate::commands::fmu::host(file, &args.options);
    }
    let name = args.name.as_deref().unwrap_or_default();
    if let Some(result) = crate::bench::run_ping_pong_end(name) {
        return match result {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("error: {error:#}");
                ExitCode::from(1)
            }
        };
    }
    match catalogue().factory(name) {
        Some(factory) => lockstep::host::run(|setup| factory(setup), &format!("{name} {}", env!("CARGO_PKG_VERSION"))),
        None => {
            eprintln!(
                "error: there is no builtin participant `{name}`; there is {}",
                catalogue().names().collect::<Vec<_>>().join(", ")
            );
            ExitCode::from(2)
        }
    }
}
