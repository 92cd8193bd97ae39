//! Lockstep co-simulation over shared memory.

pub mod port;
pub mod time;
