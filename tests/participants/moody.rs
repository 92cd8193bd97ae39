//! A controller that is not deterministic: its output depends on the number of its process.

use std::process::ExitCode;

use escapement_tests::faulty;
use escapement_tests::parts::Push;

fn main() -> ExitCode {
    faulty::altered("moody", |_, outputs| {
        outputs.get_mut::<Push>(0).force += f64::from(std::process::id()) * 1e-9;
    })
}
