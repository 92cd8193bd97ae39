//! What tests of several packages share. No library and no program links it.

pub mod allocation;
pub mod random;

pub use loom;
