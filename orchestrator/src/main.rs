//! Escapement's program. All of it stands in the library of the same name, so that its decoders can be tried from outside.

use std::process::ExitCode;

fn main() -> ExitCode {
    orchestrator::main()
}
