//! The plant as a separate process.

use std::process::ExitCode;

fn main() -> ExitCode {
    lockstep::host::run(
        plant_proc::factory,
        concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")),
    )
}
