//! Utilities that tests of several packages share. No library and no program links this crate.

pub mod random;

pub use allocation;
pub use loom;
