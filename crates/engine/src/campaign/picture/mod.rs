//! Pictures of a campaign: over one or two varied keys, or as distributions.

pub(super) mod content;
pub(super) mod draw;
pub(super) mod over_one;
pub(super) mod over_two;
pub(super) mod spread;
