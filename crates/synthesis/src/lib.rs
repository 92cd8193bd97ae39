//! Structured H-infinity tuning and mu analysis.

pub mod balance;
pub mod delay;
pub mod interconnect;
pub mod linalg;
pub mod norm;
pub mod state_space;
