//! Lock-free protocols of shared memory: sample transfer, rings, wake-up, clock.
//!
//! Everything here works on words and boards that the caller provides, wherever they are, and names no shared memory library.
//! `tests/ordering` includes these same files with the atomics of a model checker in place of [`sync`], and explores the orders in which
//! two processors may see them.

pub(crate) mod board;
pub(crate) mod clock;
pub(crate) mod entries;
pub(crate) mod room;
pub(crate) mod slots;
pub(crate) mod sync;
#[cfg(test)]
mod tests;
pub(crate) mod wait_reason;
pub(crate) mod words;
