//! The messages, one file a sender.

mod commands;
mod measurements;
mod truth;

pub use commands::*;
pub use measurements::*;
pub use truth::*;
