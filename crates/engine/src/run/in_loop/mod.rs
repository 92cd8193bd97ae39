//! The executor that runs all participants in one loop of this process.

pub(super) mod batched;
pub(super) mod direct;
pub(super) mod executor;
pub(super) mod held;
pub(super) mod logs;
