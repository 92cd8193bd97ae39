//! Shards of a campaign on other machines: bundles, and the merging of their results.

pub(super) mod bundle;
pub(super) mod merge;
pub(super) mod shard;
