//! Needs 3 ms of wall time for every step, but returns.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::run_before_step("slow", |_| std::thread::sleep(std::time::Duration::from_millis(3)))
}
