//! The messages, one file per sender.

mod commands;
mod measurements;
mod truth;

pub use commands::*;
pub use measurements::*;
pub use truth::*;
