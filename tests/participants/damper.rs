//! A healthy controller.

use std::process::ExitCode;

use escapement_tests::participants::Damper;

fn main() -> ExitCode {
    lockstep::host::run(Damper::factory, "damper")
}
