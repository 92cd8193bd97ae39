//! Atomics of the processor. The tests of memory ordering put those of a model checker in this file's place.

pub(crate) use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Writes `bytes` over `words`, not atomically.
///
/// # Safety
/// There are as many bytes in `words`, and no thread of this process looks at them at the same time.
#[inline]
pub(crate) unsafe fn write_bytes(words: &[AtomicU64], bytes: &[u8]) {
    debug_assert!(bytes.len() <= size_of_val(words), "{} words", words.len());
    // SAFETY: the words are cells, which may be written through a shared reference; the caller answers for the rest.
    unsafe {
        bytes
            .as_ptr()
            .copy_to_nonoverlapping(words.as_ptr().cast_mut().cast::<u8>(), bytes.len())
    };
}
