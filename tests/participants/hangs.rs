//! Never returns from a step.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::run_before_step("hangs", |step| {
        if step.t >= 2.0 {
            loop {
                std::thread::sleep(std::time::Duration::from_secs(1));
            }
        }
    })
}
