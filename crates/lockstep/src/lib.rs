//! Lockstep co-simulation over shared memory.

// Tests in this crate use the same paths as tests outside of it.
#[cfg(test)]
extern crate self as lockstep;

pub mod control;
pub mod executor;
pub mod fault;
pub mod fnv;
pub mod host;
pub mod link;
pub mod name;
mod panic;
pub mod participant;
pub mod plan;
pub mod port;
pub mod random;
pub mod span;
pub mod stepper;
pub mod time;
pub mod transport;
pub mod units;
pub mod wire;
