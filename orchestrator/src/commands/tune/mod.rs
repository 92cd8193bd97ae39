//! `escapement tune SPEC`: gains by structured H-infinity, verified before they are written.

mod arguments;
mod matrices;
mod print;
mod progress;
mod robot;
mod verify;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::destination;
pub use arguments::TuneArgs;
use matrices::tune_matrices;
use robot::tune_robot;

/// Tunes, verifies, writes; returns the exit code.
pub fn run(args: &TuneArgs) -> anyhow::Result<i32> {
    let is_matrices = args.is_of_matrices();
    if let Some(option) = args.option_of_robot().filter(|_| is_matrices) {
        eprintln!(
            "error: {option}: {} is a plant of matrices, which has no robot: the option is for a specification (.spec.toml) \
             alone; leave it out",
            args.spec.display()
        );
        return Ok(arguments::REFUSED);
    }
    for (option, path) in [
        ("--out", &args.out),
        ("--export-problem", &args.export_problem),
        ("--plots", &args.plots),
    ] {
        path.iter().try_for_each(|path| destination::check(option, path))?;
    }
    if args.starts == Some(0) {
        eprintln!("error: --starts 0: a search needs a start; write 1 or more, or leave the option out");
        return Ok(arguments::REFUSED);
    }
    let gains = args.gains_path();
    destination::check_distinct(&[("SPEC", &args.spec)], &args.destinations(gains.as_deref()))?;
    let text = match std::fs::read_to_string(&args.spec) {
        Ok(text) => text,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(arguments::REFUSED);
        }
    };
    let stop = Arc::new(AtomicBool::new(false));
    // The order of these two lines ensures that the second Ctrl-C finds the flag set and ends the program.
    signal_hook::flag::register_conditional_shutdown(signal_hook::consts::SIGINT, 130, Arc::clone(&stop))?;
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::clone(&stop))?;
    if is_matrices {
        tune_matrices(args, &text, &stop)
    } else {
        tune_robot(args, &text, &stop)
    }
}
