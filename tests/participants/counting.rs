//! A damper that panics when its process has allocated heap memory since its second step.

use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};

use escapement_tests::faulty;
use testing::allocation::{Counting, process_allocations};

static AT_SECOND_STEP: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn main() -> ExitCode {
    faulty::run_before_step("counting", |step| {
        let taken = process_allocations();
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
