//! Structured H-infinity tuning and mu analysis.

pub mod balance;
pub mod delay;
pub mod full_order;
pub mod interconnect;
pub mod linalg;
pub mod matrices;
pub mod mu;
pub mod norm;
pub mod plot;
pub mod reduce;
mod rng;
pub mod robot;
pub mod state_space;
pub mod tuner;
