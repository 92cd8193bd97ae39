//! Shared memory as words: one process writes while another reads, so every access is atomic.

use std::sync::atomic::{AtomicU64, Ordering};

use iceoryx2::prelude::ZeroCopySend;

/// A word of shared memory.
#[derive(Debug)]
#[repr(transparent)]
pub(super) struct Word(AtomicU64);

// SAFETY: a 64-bit integer: no pointers, no padding, no drop.
unsafe impl ZeroCopySend for Word {
    unsafe fn type_name() -> &'static str {
        "u64"
    }
}

impl Word {
    pub(super) const fn new(value: u64) -> Word {
        Word(AtomicU64::new(value))
    }

    pub(super) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    pub(super) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// The value, and with it everything that was written before it was announced.
    pub(super) fn heard(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }

    /// Sets the value, for those who then see what was written before.
    pub(super) fn announce(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

/// Writes `bytes`, the last word filled up with zeros.
pub(super) fn put(words: &[Word], bytes: &[u8]) {
    let (whole, rest) = bytes.as_chunks::<8>();
    words
        .iter()
        .zip(whole)
        .for_each(|(word, bytes)| word.set(u64::from_ne_bytes(*bytes)));
    if !rest.is_empty() {
        let mut last = [0; 8];
        last[..rest.len()].copy_from_slice(rest);
        words[whole.len()].set(u64::from_ne_bytes(last));
    }
}

/// Reads as many bytes as `bytes` has.
pub(super) fn take(words: &[Word], bytes: &mut [u8]) {
    let (whole, rest) = bytes.as_chunks_mut::<8>();
    words
        .iter()
        .zip(&mut *whole)
        .for_each(|(word, bytes)| *bytes = word.get().to_ne_bytes());
    if !rest.is_empty() {
        rest.copy_from_slice(&words[whole.len()].get().to_ne_bytes()[..rest.len()]);
    }
}
