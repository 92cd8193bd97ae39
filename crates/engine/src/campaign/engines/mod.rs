//! Engines: they run the shards of a campaign on other machines.
//!
//! An engine starts `shard.sh K` on some machine for each missing shard K. The results are in the shards' folders: an
//! engine that loses a shard, runs it twice or loses its state changes no result.

mod batches;
mod dispatch;
mod engine;
mod hyperqueue;
mod job;
mod slurm;
mod submit;

pub use batches::{Step, submit};
pub use engine::Engine;
pub use submit::{Cluster, SubmittedShards, Waiting, waiting};
