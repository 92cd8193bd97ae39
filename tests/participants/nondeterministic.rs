//! A controller that is not deterministic: its output depends on its process id.

use std::process::ExitCode;

use escapement_tests::faulty;
use escapement_tests::participants::Push;

fn main() -> ExitCode {
    faulty::run_after_step("nondeterministic", |_, outputs| {
        outputs.get_mut::<Push>(0).force += f64::from(std::process::id()) * 1e-9;
    })
}
