//! Execution of the points: a pool of worker processes, each of which runs several points side by side.

pub(super) mod batch_size;
pub(super) mod batched;
mod pending_point;
pub(super) mod point;
pub(super) mod pool;
pub(super) mod worker;
