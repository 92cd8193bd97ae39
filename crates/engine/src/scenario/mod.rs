//! The file that a user writes, and what it means.

mod error;
mod failure;
mod faults;
mod guards;
mod initial;
mod program;
mod resolve;
mod source;
mod types;

pub use error::ScenarioError;
pub use failure::OnFailure;
pub use faults::{State, Substitution, table as fault_table};
pub use program::{Program, in_path};
pub use resolve::{Entry, Scenario};
pub use source::fault_name;
