//! The cores that this process may use.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// Their numbers.
pub(super) fn cores() -> Vec<usize> {
    let allowed = sched_getaffinity(None).ok();
    allowed
        .map(|set| (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core)).collect())
        .unwrap_or_default()
}

/// Pins this thread to the core number `which` of those that it may use.
pub(super) fn pin_thread_to(which: usize) {
    let cores = cores();
    if cores.len() > 1 {
        let mut set = CpuSet::new();
        set.set(cores[which % cores.len()]);
        let _ = sched_setaffinity(None, &set);
    }
}
