//! A damper that panics when its process holds more heap memory at any step than it did at its second.
//!
//! The participant, the stepper and the host allocate nothing between two steps. iceoryx2 itself makes a handle of 48 bytes for
//! every loan and drops it with the send, and formats a name for every sleep, so counting calls would count those.

use std::alloc::{GlobalAlloc, Layout, System};
use std::process::ExitCode;
use std::sync::atomic::{AtomicI64, Ordering};

use escapement_tests::faulty;

struct Counting;

static HELD: AtomicI64 = AtomicI64::new(0);
static AT_SECOND_STEP: AtomicI64 = AtomicI64::new(0);

// SAFETY: every call goes to the system's allocator unchanged; counting neither allocates nor fails.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.fetch_add(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size() as i64, Ordering::Relaxed);
        // SAFETY: the block came from `alloc` above with the same layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn main() -> ExitCode {
    faulty::damper("counting", |step| {
        let held = HELD.load(Ordering::Relaxed);
        match step.index {
            0 => {}
            1 => AT_SECOND_STEP.store(held, Ordering::Relaxed),
            _ => {
                let more = held - AT_SECOND_STEP.load(Ordering::Relaxed);
                assert!(more <= 0, "{more} bytes more at step {} than at the second", step.index);
            }
        }
    })
}
