//! Shared memory as words: one process writes while another may read, so what is read, is read atomically.

use super::sync::{AtomicU64, Ordering, fence, write_bytes};

/// A word of shared memory.
#[derive(Debug)]
#[repr(transparent)]
pub(crate) struct Word(AtomicU64);

/// Words of a cache line.
pub(crate) const LINE: usize = 8;

impl Word {
    pub(crate) fn new(value: u64) -> Word {
        Word(AtomicU64::new(value))
    }

    #[inline]
    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    #[inline]
    pub(crate) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// The value, and with it everything that was written before it was announced.
    #[inline]
    pub(crate) fn heard(&self) -> u64 {
        // A relaxed load is the only one that memory which may only be read is good for.
        let value = self.0.load(Ordering::Relaxed);
        fence(Ordering::Acquire);
        value
    }

    /// Sets the value, for those who then see what was written before.
    #[inline]
    pub(crate) fn announce(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

/// Writes `bytes`, the last word filled up with zeros. Nobody may look at these words before they have been announced.
///
/// # Panics
/// When there are not enough words.
pub(crate) fn put(words: &[Word], bytes: &[u8]) {
    let words = &words[..bytes.len().div_ceil(8)];
    if !bytes.len().is_multiple_of(8) {
        words[words.len() - 1].set(0);
    }
    // SAFETY: a `Word` is an `AtomicU64` and nothing else.
    let cells = unsafe { &*(std::ptr::from_ref(words) as *const [AtomicU64]) };
    // SAFETY: there is room, as the first line has checked; who reads these words in this process does so after an announcement that follows. What another process does to them
    // in the meantime can only spoil what it reads itself.
    unsafe { write_bytes(cells, bytes) };
}

/// Reads as many bytes as `bytes` has.
pub(crate) fn take(words: &[Word], bytes: &mut [u8]) {
    let (whole, rest) = bytes.as_chunks_mut::<8>();
    words
        .iter()
        .zip(&mut *whole)
        .for_each(|(word, bytes)| *bytes = word.get().to_ne_bytes());
    if !rest.is_empty() {
        rest.copy_from_slice(&words[whole.len()].get().to_ne_bytes()[..rest.len()]);
    }
}
