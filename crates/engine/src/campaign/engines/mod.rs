//! Engines that run the shards of a campaign on other machines.
//!
//! An engine starts `shard.sh K` somewhere, for each shard K that is missing. What it makes of that is in the shards' folders: an engine that
//! loses a shard, runs it twice or forgets everything changes no result.

mod dispatch;
mod engine;
mod enough;
mod hyperqueue;
mod job;
mod slurm;
mod submit;

pub use engine::Engine;
pub use enough::{Step, submit};
pub use submit::{Cluster, Underway, Waiting, waiting};
