//! Stops of a run: when all participants are paused, and what is done then.

pub(super) mod actions;
pub(super) mod instants;
pub(super) mod schedule;
