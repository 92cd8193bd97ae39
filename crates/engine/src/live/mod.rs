//! Live page: a run can be watched and controlled from a browser while it is in progress.
//!
//! The run and the page share a [`Steering`], a few atomic numbers, and the files of the tape. The server's threads read
//! the files; the run never waits for a browser.

mod http;
mod pages;
mod server;
mod steering;

pub use server::{Server, refusal};
pub use steering::Steering;
