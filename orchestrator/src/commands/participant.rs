//! `escapement participant NAME`: a participant that this program contains, in a process of its own.

use std::process::ExitCode;

use crate::cli::ParticipantArgs;
use crate::program::catalogue;

/// Takes its place in the run that the environment names.
pub fn run(args: &ParticipantArgs) -> ExitCode {
    if let Some(result) = crate::bench::be_an_end(&args.name) {
        return match result {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("error: {error:#}");
                ExitCode::from(1)
            }
        };
    }
    match catalogue().factory(&args.name) {
        Some(factory) => lockstep::host::run(
            |setup| factory(setup),
            &format!("{} {}", args.name, env!("CARGO_PKG_VERSION")),
        ),
        None => {
            eprintln!(
                "error: there is no builtin participant `{}`; there is {}",
                args.name,
                catalogue().names().collect::<Vec<_>>().join(", ")
            );
            ExitCode::from(2)
        }
    }
}
