//! The atomics of the model checker, in place of `src/transport/lock_free/sync.rs`.
//!
//! They add two checks to those of a processor: a non-atomic access must not race with another access, and a thread can
//! [`weaken`] an ordering, to show that it is needed.

use std::cell::Cell;
pub(crate) use std::sync::atomic::Ordering;

use testing::loom::cell::UnsafeCell;
use testing::loom::sync::atomic;

testing::loom::thread_local! {
    static WEAKENED: Cell<Option<Ordering>> = Cell::new(None);
}

/// From here on, this thread's accesses and fences are made without `ordering`.
pub(crate) fn weaken(ordering: Option<Ordering>) {
    WEAKENED.with(|weakened| weakened.set(ordering));
}

fn is_weakened(ordering: Ordering) -> bool {
    WEAKENED.with(|weakened| weakened.get() == Some(ordering))
}

fn effective(ordering: Ordering) -> Ordering {
    if is_weakened(ordering) {
        Ordering::Relaxed
    } else {
        ordering
    }
}

#[derive(Debug)]
pub(crate) struct AtomicU64 {
    value: atomic::AtomicU64,
    /// Follows accesses that are not atomic.
    plain: UnsafeCell<()>,
}

// SAFETY: the cell holds nothing; it is there for the model checker to follow.
unsafe impl Sync for AtomicU64 {}

impl AtomicU64 {
    pub(crate) fn new(value: u64) -> AtomicU64 {
        AtomicU64 {
            value: atomic::AtomicU64::new(value),
            plain: UnsafeCell::new(()),
        }
    }

    pub(crate) fn load(&self, ordering: Ordering) -> u64 {
        self.plain.with(|_| ());
        self.value.load(effective(ordering))
    }

    pub(crate) fn store(&self, value: u64, ordering: Ordering) {
        self.value.store(value, effective(ordering));
    }
}

pub(crate) fn fence(ordering: Ordering) {
    match (ordering, is_weakened(ordering)) {
        (_, false) => atomic::fence(ordering),
        (Ordering::SeqCst, true) => atomic::fence(Ordering::AcqRel),
        (_, true) => {}
    }
}

/// Writes `bytes` over `words`, the last word filled up with zeros, not atomically.
///
/// # Safety
/// No condition: the model checker detects races itself.
pub(crate) unsafe fn write_bytes(words: &[AtomicU64], bytes: &[u8]) {
    for (word, bytes) in words.iter().zip(bytes.chunks(8)) {
        let mut whole = [0; 8];
        whole[..bytes.len()].copy_from_slice(bytes);
        word.plain.with_mut(|_| ());
        word.value.store(u64::from_ne_bytes(whole), Ordering::Relaxed);
    }
}
