//! Command line of a co-simulation: a [`Program`] runs, checks, sweeps, replays, compares, reports and exports scenarios,
//! with its own participants. The feature `capture` (the default) adds the stock program, and the commands that only the
//! capture has: `tune`, `margins` and `model`.

#[macro_use]
mod output;

mod arguments;
mod bench;
mod catalogue;
mod cli;
mod commands;
#[cfg(feature = "capture")]
pub mod decoders;
mod destination;
mod limits;
mod line;
mod program;
mod refusal;
mod signals;
#[cfg(feature = "capture")]
mod spring;
#[cfg(feature = "capture")]
pub mod stock;
mod templates;
mod terminal;
mod version;

pub use program::Program;
pub use version::ESCAPEMENT as VERSION;
