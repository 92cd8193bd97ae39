//! Panics in the middle of the run.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::run_before_step("panics", |step| {
        assert!(step.t < 2.0, "the valve is stuck at t = {} s", step.t)
    })
}
