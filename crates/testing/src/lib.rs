//! What tests of several packages share. No library and no program links it.

pub mod random;

pub use allocation;
pub use loom;
