//! What lockstep costs on this machine, as ratios measured side by side in one run.

mod ahead;
mod deaths;
mod exchange;
mod figures;
mod participants;
mod scaling;
mod share;

pub use ahead::{STEPS, ahead};
pub use deaths::deaths;
pub use exchange::{be_an_end, exchange};
pub use figures::Figures;
pub use participants::{register, ring};
pub use scaling::scaling;
pub use share::share;
