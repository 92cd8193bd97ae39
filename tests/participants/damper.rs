//! A healthy controller.

use std::process::ExitCode;

use escapement_tests::parts::Damper;

fn main() -> ExitCode {
    lockstep::host::run(Damper::factory, "damper")
}
