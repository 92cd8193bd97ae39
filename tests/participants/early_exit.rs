//! Ends before it has entered the run.

use std::process::ExitCode;

fn main() -> ExitCode {
    eprintln!("the licence server does not answer");
    ExitCode::from(7)
}
