//! An allocator that counts heap allocations.
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: allocation::Counting = allocation::Counting;
//!
//! assert_eq!(allocation::allocations_during(|| drop(std::hint::black_box(Box::new(7_u8)))).count, 1);
//! ```

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// The allocations of a thread.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Allocations {
    /// The number of allocations.
    pub count: u64,
    /// The largest allocation, bytes.
    pub largest_bytes: usize,
    /// Allocated and not yet freed, bytes.
    pub live_bytes: i64,
}

/// The system's allocator, with a count for each thread and for the process.
pub struct Counting;

static PROCESS_ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static THREAD_ALLOCATIONS: Cell<Allocations> = const { Cell::new(Allocations { count: 0, largest_bytes: 0, live_bytes: 0 }) };
}

fn count(size: usize, freed: usize) {
    PROCESS_ALLOCATIONS.fetch_add(u64::from(size > 0), Ordering::Relaxed);
    THREAD_ALLOCATIONS.with(|cell| {
        let mut taken = cell.get();
        taken.count += u64::from(size > 0);
        taken.largest_bytes = taken.largest_bytes.max(size);
        taken.live_bytes += size as i64 - freed as i64;
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
pub fn allocations_during(work: impl FnOnce()) -> Allocations {
    THREAD_ALLOCATIONS.set(Allocations::default());
    drop(std::hint::black_box(Box::new(1_u8)));
    assert_eq!(
        THREAD_ALLOCATIONS.get().count,
        1,
        "the counting allocator is not the program's"
    );
    THREAD_ALLOCATIONS.set(Allocations::default());
    work();
    THREAD_ALLOCATIONS.get()
}

/// The number of allocations of this process, in all threads together.
pub fn process_allocations() -> u64 {
    PROCESS_ALLOCATIONS.load(Ordering::Relaxed)
}
