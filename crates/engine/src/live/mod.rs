//! A run that can be watched and steered from a page while it goes on.
//!
//! The run and the page meet in a [`Steering`], a handful of atomic numbers, and in the files of the tape. The server's
//! threads read the files; whatever a browser does, the run never waits for it.

mod http;
mod server;
mod steering;

pub use server::{Server, refusal};
pub use steering::Steering;
