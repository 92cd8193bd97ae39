//! Aborts the process in the middle of the run.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::run_before_step("crash_at", |step| {
        if step.t >= 2.0 {
            std::process::abort();
        }
    })
}
