//! Takes its time in every step, but comes back.

use std::process::ExitCode;

use escapement_tests::faulty;

fn main() -> ExitCode {
    faulty::damper("slow", |_| std::thread::sleep(std::time::Duration::from_millis(3)))
}
