//! Lock-free protocols of shared memory: hand-over of samples, rings, wake-up, clock.
//!
//! Everything here works on words and boards that a caller lends, wherever these lie, and names no library of shared memory.
//! `tests/ordering` includes these very files with the atomics of a model checker in place of [`sync`], and goes through the orders in
//! which two processors may see them.

pub(crate) mod asleep;
pub(crate) mod board;
pub(crate) mod clock;
pub(crate) mod entries;
pub(crate) mod room;
pub(crate) mod slots;
pub(crate) mod sync;
#[cfg(test)]
mod tests;
pub(crate) mod words;
