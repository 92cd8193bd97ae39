//! Cost of lockstep on this machine, as ratios of measurements taken side by side.

mod cores;
mod deaths;
mod delay_benefit;
mod exchange;
mod measurements;
mod overhead;
mod participants;
mod polled;
mod scaling;

pub use deaths::death_detection_latency;
pub use delay_benefit::{STEPS, delay_benefit};
pub use exchange::{exchange, run_ping_pong_end};
pub use measurements::Measurements;
pub use overhead::overhead;
pub use participants::{register, ring, unrecorded};
pub use scaling::scaling;
