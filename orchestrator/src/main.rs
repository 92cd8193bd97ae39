//! Escapement's program. All code is in the library, so that other programs can have the same command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    orchestrator::stock::program().main()
}
