//! Notifying a participant that its part in the run is over.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::panic::message;
use crate::participant::{Log, Participant, Termination};

/// Notifies a participant that its part in the run is over. A panic in that call is written to its log: nothing depends on it any more.
pub fn terminate(participant: &mut dyn Participant, why: Termination, log: &Log) {
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| participant.terminate(why, log))) {
        log.write(format_args!("it panicked in `terminate`: {}", message(&*panic)));
    }
}
