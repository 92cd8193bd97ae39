//! The multi-threaded executor: a thread for each participant, over local links, with the least constrained interleaving in one process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use super::{LocalParticipant, RunError};
use crate::stepper::Progress;
use crate::time::Ticks;

/// Runs every participant in a thread of its own until all activations before `horizon` are complete. The first failure stops all
/// participants and is returned.
pub fn run_in_threads(parts: Vec<LocalParticipant>, horizon: Ticks) -> Result<(), RunError> {
    let stop = &AtomicBool::new(false);
    let results: Vec<Result<(), RunError>> = thread::scope(|scope| {
        let handles: Vec<_> = parts
            .into_iter()
            .map(|part| {
                scope.spawn(move || {
                    let mut stepper = part.into_stepper();
                    stepper.extend_horizon(horizon);
                    while !stop.load(Ordering::Relaxed) {
                        match stepper.poll() {
                            Ok(Progress::Stepped) => {}
                            Ok(Progress::AtHorizon | Progress::Finished) => return Ok(()),
                            Ok(Progress::Waiting(_) | Progress::BeforeStep | Progress::Deferred) => thread::yield_now(),
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
