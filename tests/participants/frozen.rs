//! A controller whose output freezes in the middle of the run.

use std::process::ExitCode;
use std::sync::OnceLock;

use escapement_tests::faulty;
use escapement_tests::participants::Push;

fn main() -> ExitCode {
    static FROZEN: OnceLock<Push> = OnceLock::new();
    faulty::run_after_step("frozen", |step, outputs| {
        if step.t >= 2.0 {
            let push = outputs.get_mut::<Push>(0);
            *push = *FROZEN.get_or_init(|| *push);
        }
    })
}
