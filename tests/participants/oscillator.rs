//! A healthy plant.

use std::process::ExitCode;

use escapement_tests::participants::Oscillator;

fn main() -> ExitCode {
    lockstep::host::run(Oscillator::factory, "oscillator")
}
