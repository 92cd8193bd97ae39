//! A participant that writes down what becomes of it.

use std::process::ExitCode;

use escapement_tests::diary::Diary;

fn main() -> ExitCode {
    lockstep::host::run(Diary::factory, "diary")
}
