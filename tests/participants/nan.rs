//! Computes a NaN in the middle of the run.

use std::process::ExitCode;

use escapement_tests::faulty;
use escapement_tests::parts::Push;

fn main() -> ExitCode {
    faulty::altered("nan", |step, outputs| {
        if step.t >= 2.0 {
            outputs.get_mut::<Push>(0).force = f64::NAN;
        }
    })
}
