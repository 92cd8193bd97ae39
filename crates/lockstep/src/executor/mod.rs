//! Executors in one process: a plain loop, and a thread for each participant.
//!
//! Both drive the same [`Stepper`](crate::stepper::Stepper)s over local links. The processes over shared memory are driven by [`crate::host`].

mod in_loop;
mod part;
mod threads;

pub use in_loop::{InLoop, Moment, Reach};
pub use part::{Part, RunError, assemble};
pub use threads::run_in_threads;
