//! Atomics of the processor. The tests of memory ordering replace this file by the atomics of a model checker.

pub(crate) use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Writes `bytes` over `words`, not atomically.
///
/// # Safety
/// `words` has room for as many bytes, and no thread of this process accesses them at the same time.
#[inline]
pub(crate) unsafe fn write_bytes(words: &[AtomicU64], bytes: &[u8]) {
    debug_assert!(bytes.len() <= size_of_val(words), "{} words", words.len());
    // SAFETY: the words are cells, which may be written through a shared reference; the caller guarantees the rest.
    unsafe {
        bytes
            .as_ptr()
            .copy_to_nonoverlapping(words.as_ptr().cast_mut().cast::<u8>(), bytes.len())
    };
}
