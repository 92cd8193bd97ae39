//! Leaves in the middle of the run as if it were done.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::damper("exit_at", |step| {
        if step.t >= 2.0 {
            std::process::exit(0);
        }
    })
}
