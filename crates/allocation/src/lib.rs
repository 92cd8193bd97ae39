//! An allocator that counts heap allocations.
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: allocation::Counting = allocation::Counting;
//!
//! assert_eq!(allocation::taken_by(|| drop(std::hint::black_box(Box::new(7_u8)))).times, 1);
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// The allocations of a thread.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Taken {
    /// The number of allocations.
    pub times: u64,
    /// The largest allocation, bytes.
    pub largest: usize,
    /// Allocated and not yet freed, bytes.
    pub held: i64,
}

/// The system's allocator, with a count for each thread and for the process.
pub struct Counting;

static TAKEN_BY_ALL: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static TAKEN: Cell<Taken> = const { Cell::new(Taken { times: 0, largest: 0, held: 0 }) };
}

fn count(size: usize, given_back: usize) {
    TAKEN_BY_ALL.fetch_add(u64::from(size > 0), Ordering::Relaxed);
    TAKEN.with(|cell| {
        let mut taken = cell.get();
        taken.times += u64::from(size > 0);
        taken.largest = taken.largest.max(size);
        taken.held += size as i64 - given_back as i64;
        cell.set(taken);
    });
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches an atomic and a thread-local without a destructor,
// and allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller's guarantee is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: the caller's guarantee is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: the caller's guarantee is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// The allocations of `work` in this thread.
///
/// # Panics
/// When [`Counting`] is not the allocator of this program: then nothing would be counted.
pub fn taken_by(work: impl FnOnce()) -> Taken {
    TAKEN.set(Taken::default());
    drop(std::hint::black_box(Box::new(1_u8)));
    assert_eq!(TAKEN.get().times, 1, "the counting allocator is not the program's");
    TAKEN.set(Taken::default());
    work();
    TAKEN.get()
}

/// The number of allocations of this process, in all threads together.
pub fn taken_by_all() -> u64 {
    TAKEN_BY_ALL.load(Ordering::Relaxed)
}
