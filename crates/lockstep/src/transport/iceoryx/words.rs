//! Shared memory as words: one process writes while another may read, so what is read, is read atomically.

use std::sync::atomic::{AtomicU64, Ordering, fence};

use iceoryx2::prelude::ZeroCopySend;

/// A word of shared memory.
#[derive(Debug)]
#[repr(transparent)]
pub(super) struct Word(AtomicU64);

/// Words of a cache line.
pub(super) const LINE: usize = 8;

/// A cache line of words: what shared memory is counted in.
#[derive(Debug)]
#[repr(transparent)]
pub(super) struct Line([Word; LINE]);

// SAFETY: 64-bit integers in a row: no pointers, no padding, no drop.
unsafe impl ZeroCopySend for Line {
    unsafe fn type_name() -> &'static str {
        "EscapementLine"
    }
}

impl Word {
    pub(super) const fn new(value: u64) -> Word {
        Word(AtomicU64::new(value))
    }

    #[inline]
    pub(super) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    #[inline]
    pub(super) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// The value, and with it everything that was written before it was announced.
    #[inline]
    pub(super) fn heard(&self) -> u64 {
        // A relaxed load is the only one that memory which may only be read is good for.
        let value = self.0.load(Ordering::Relaxed);
        fence(Ordering::Acquire);
        value
    }

    /// Sets the value, for those who then see what was written before.
    #[inline]
    pub(super) fn announce(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

/// Writes `bytes`, the last word filled up with zeros. Nobody may look at these words before they have been announced.
///
/// # Panics
/// When there are not enough words.
pub(super) fn put(words: &[Word], bytes: &[u8]) {
    let words = &words[..bytes.len().div_ceil(8)];
    if !bytes.len().is_multiple_of(8) {
        words[words.len() - 1].set(0);
    }
    // SAFETY: there is room, as the line above has checked; the words are cells, which may be written through a shared reference; and
    // who reads them in this process does so after an announcement that follows. What another process does to them in the
    // meantime can only spoil what it reads itself.
    unsafe {
        bytes
            .as_ptr()
            .copy_to_nonoverlapping(words.as_ptr().cast_mut().cast::<u8>(), bytes.len())
    };
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
