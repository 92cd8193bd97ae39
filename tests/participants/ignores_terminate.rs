//! Blocks every signal that can be blocked and hangs at the end of the run.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::damper("ignores_terminate", |step| {
        while step.t >= 0.5 {
            std::thread::park();
        }
    })
}
