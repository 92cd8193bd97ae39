//! Charts of a campaign: over one or two varied keys, or as distributions.

pub(super) mod content;
pub(super) mod distribution;
pub(super) mod draw;
pub(super) mod one_key;
pub(super) mod two_keys;
