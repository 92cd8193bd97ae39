//! The guidance in a process of its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    lockstep::host::run(
        guidance_proc::factory,
        concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")),
    )
}
