//! A damper that panics when its process has taken anything from the heap since its second step.

use std::alloc::{GlobalAlloc, Layout, System};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

use escapement_tests::faulty;

struct Counting;

static TAKEN: AtomicU64 = AtomicU64::new(0);
static AT_SECOND_STEP: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call goes to the system's allocator unchanged; counting neither allocates nor fails.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: the block came from `alloc` above with the same layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn main() -> ExitCode {
    faulty::damper("counting", |step| {
        let taken = TAKEN.load(Ordering::Relaxed);
        match step.index {
            0 => {}
            1 => AT_SECOND_STEP.store(taken, Ordering::Relaxed),
            _ => {
                let since = taken - AT_SECOND_STEP.load(Ordering::Relaxed);
                assert!(
                    since == 0,
                    "{since} pieces of memory taken between the second step and step {}",
                    step.index
                );
            }
        }
    })
}
