//! Limits of a plan.

/// The most participants of a run.
pub const PARTICIPANTS_MAX: usize = 512;

/// The most samples that one link may hold.
pub(super) const CAPACITY_MAX: u128 = 1 << 16;
