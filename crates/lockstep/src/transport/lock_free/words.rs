//! Shared memory as words: one process writes while another may read, so every read is atomic.

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

    /// Reads the value; everything that was written before it was announced is then visible.
    #[inline]
    pub(crate) fn load_acquire(&self) -> u64 {
        // Only a relaxed load works on read-only memory.
        let value = self.0.load(Ordering::Relaxed);
        fence(Ordering::Acquire);
        value
    }

    /// Sets the value; a reader that sees it also sees what was written before.
    #[inline]
    pub(crate) fn store_release(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

/// Writes `bytes`, the last word padded with zeros. These words must not be read before they have been announced.
///
/// # Panics
/// When there are not enough words.
pub(crate) fn copy_in(words: &[Word], bytes: &[u8]) {
    let words = &words[..bytes.len().div_ceil(8)];
    if !bytes.len().is_multiple_of(8) {
        words[words.len() - 1].set(0);
    }
    // SAFETY: a `Word` contains only an `AtomicU64`.
    let cells = unsafe { &*(std::ptr::from_ref(words) as *const [AtomicU64]) };
    // SAFETY: there is room, as the first line has checked; a reader of these words in this process reads them after an announcement that
    // follows. Another process that accesses them in the meantime can only corrupt what it reads itself.
    unsafe { write_bytes(cells, bytes) };
}

/// Reads as many bytes as `bytes` has.
pub(crate) fn copy_out(words: &[Word], bytes: &mut [u8]) {
    let (whole, rest) = bytes.as_chunks_mut::<8>();
    let words = &words[..whole.len() + usize::from(!rest.is_empty())];
    let copy = |(word, bytes): (&Word, &mut [u8; 8])| *bytes = word.get().to_ne_bytes();
    // Line by line: atomic reads are not combined, but those of a line need no loop.
    let (lines, last) = words.as_chunks::<LINE>();
    let (whole_lines, whole_last) = whole.as_chunks_mut::<LINE>();
    for (line, bytes) in lines.iter().zip(whole_lines) {
        line.iter().zip(bytes).for_each(copy);
    }
    last.iter().zip(&mut *whole_last).for_each(copy);
    if !rest.is_empty() {
        rest.copy_from_slice(&words[words.len() - 1].get().to_ne_bytes()[..rest.len()]);
    }
}
