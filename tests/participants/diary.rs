//! A participant that logs its life cycle.

use std::process::ExitCode;

use escapement_tests::diary::Diary;

fn main() -> ExitCode {
    lockstep::host::run(Diary::factory, "diary")
}
