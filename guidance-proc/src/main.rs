//! The guidance as a separate process.

use std::process::ExitCode;

fn main() -> ExitCode {
    lockstep::host::run(
        guidance_proc::factory,
        concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")),
    )
}
