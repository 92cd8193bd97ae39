//! The executor that runs all participants in one loop of this process.

pub(super) mod batched;
pub(super) mod direct;
pub(super) mod executor;
pub(super) mod logs;
pub(super) mod step_pause;
