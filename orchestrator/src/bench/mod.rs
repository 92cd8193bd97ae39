//! Cost of lockstep on this machine, as ratios of measurements taken side by side.

mod ahead;
mod cores;
mod deaths;
mod exchange;
mod figures;
mod participants;
mod polled;
mod scaling;
mod share;

pub use ahead::{STEPS, ahead};
pub use deaths::deaths;
pub use exchange::{be_an_end, exchange};
pub use figures::Figures;
pub use participants::{register, ring, unrecorded};
pub use scaling::scaling;
pub use share::share;
