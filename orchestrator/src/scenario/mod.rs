//! The file that a user writes, and what it means.

mod error;
mod initial;
mod resolve;
mod source;
mod types;

pub use error::ScenarioError;
pub use resolve::{Entry, Program, Scenario};
