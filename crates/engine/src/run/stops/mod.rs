//! Stops of a run: when all participants rest, and what is done then.

pub(super) mod actions;
pub(super) mod instants;
pub(super) mod schedule;
