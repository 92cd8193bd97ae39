//! Asks for more force than any actuator has, in the middle of the run.

use std::process::ExitCode;

use escapement_tests::faulty;
use escapement_tests::parts::Push;

fn main() -> ExitCode {
    faulty::altered("out_of_range", |step, outputs| {
        if step.t >= 2.0 {
            outputs.get_mut::<Push>(0).force = 90.0;
        }
    })
}
