//! Saved runs: checkpoints, branches, and what is read back to continue from them.

pub(super) mod branch;
pub mod checkpoint;
pub(super) mod continuation;
pub(super) mod history;
pub(super) mod off_tape;
pub(super) mod restore;
