//! Executors in one process: a plain loop, and a thread for each participant.
//!
//! Both drive the same [`Stepper`](crate::stepper::Stepper)s over local links. [`crate::host`] drives the processes over shared memory.

mod in_loop;
mod local_participant;
mod threads;

pub use in_loop::{InLoop, LoopEvent, StopReason};
pub use local_participant::{LocalParticipant, RunError, connect_locally};
pub use threads::run_in_threads;
