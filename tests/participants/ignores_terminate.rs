//! Blocks every signal that can be blocked and hangs at the end of the run.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::run_before_step("ignores_terminate", |step| {
        if step.t >= 0.5 {
            loop {
                std::thread::park();
            }
        }
    })
}
