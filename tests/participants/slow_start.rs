//! The damper in a program that starts slowly: after the number of seconds in its first argument.

use std::process::ExitCode;
use std::time::Duration;

use escapement_tests::participants::Damper;

fn main() -> ExitCode {
    let seconds = std::env::args().nth(1).and_then(|text| text.parse().ok());
    std::thread::sleep(Duration::from_secs_f64(seconds.expect("a number of seconds")));
    lockstep::host::run(Damper::factory, "slow_start")
}
