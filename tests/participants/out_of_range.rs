//! Commands more force than any actuator has, in the middle of the run.

use std::process::ExitCode;

use escapement_tests::faulty;
use escapement_tests::participants::Push;

fn main() -> ExitCode {
    faulty::run_after_step("out_of_range", |step, outputs| {
        if step.t >= 2.0 {
            outputs.get_mut::<Push>(0).force = 90.0;
        }
    })
}
