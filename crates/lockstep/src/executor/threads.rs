//! A thread for each participant, over local links: the freest interleaving that one process can have.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::RunError;
use crate::stepper::{Progress, Stepper};
use crate::time::Ticks;

/// Runs every stepper in a thread of its own until all activations before `horizon` are complete. The first failure stops
/// everybody and is returned.
pub fn run_in_threads(steppers: Vec<Stepper>, horizon: Ticks) -> Result<(), RunError> {
    let stop = &AtomicBool::new(false);
    let results: Vec<Result<(), RunError>> = thread::scope(|scope| {
        let handles: Vec<_> = steppers
            .into_iter()
            .map(|mut stepper| {
                scope.spawn(move || {
                    stepper.extend_horizon(horizon);
                    while !stop.load(Ordering::Relaxed) {
                        match stepper.poll() {
                            Ok(Progress::Stepped) => {}
                            Ok(Progress::AtHorizon | Progress::Finished) => return Ok(()),
                            Ok(Progress::Waiting(_)) => thread::yield_now(),
                            Err(source) => {
                                stop.store(true, Ordering::Relaxed);
                                return Err(RunError::of(&stepper, source));
                            }
                        }
                    }
                    Ok(())
                })
            })
            .collect();
        handles
            .into_iter()
            .map(|handle| handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    results.into_iter().collect()
}
