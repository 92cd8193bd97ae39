//! Scheduler time slices: how soon the kernel gives a run's processes a core when the machine is busy with other work.
//!
//! A run's processes hand work to each other every few microseconds. With the kernel's slices of 3 ms, each hand-over on a busy
//! machine may wait until another process's slice is over. A process that asks for shorter slices gets the core sooner, but no
//! larger share of it: the share is that of any other process, so no privilege is needed. On an otherwise idle machine long slices
//! are better: with short ones the process that computes most must yield to the others in between, for fairness, although they find
//! no work.

use libc::{SCHED_BATCH, SCHED_OTHER, SYS_sched_getattr, SYS_sched_setattr, c_long, sched_attr};

/// The short slice, ns: the shortest that the kernel grants.
const SHORT_NS: u64 = 100_000;
/// The kernel's default.
const DEFAULT_NS: u64 = 0;
/// How many checks in a row must agree before the slices change.
const CHECKS_TO_CHANGE: u32 = 2;

/// The slices of this thread, and of the processes that it has started or will start.
#[derive(Debug, Default)]
pub(crate) struct TimeSlices {
    short: bool,
    disagreeing_checks: u32,
}

impl TimeSlices {
    /// Checks the load of the cores, and changes the slices of this thread and of `processes` if it has changed.
    pub(crate) fn update(&mut self, processes: impl ExactSizeIterator<Item = u32>) {
        let oversubscribed = is_oversubscribed(processes.len() + 1);
        self.disagreeing_checks = if oversubscribed == self.short {
            0
        } else {
            self.disagreeing_checks + 1
        };
        if self.disagreeing_checks == CHECKS_TO_CHANGE {
            (self.short, self.disagreeing_checks) = (oversubscribed, 0);
            let slice = if oversubscribed { SHORT_NS } else { DEFAULT_NS };
            request_slice(0, slice);
            processes.for_each(|process| request_slice(process, slice));
        }
    }
}

/// Whether more threads are runnable than there are cores, and some of them belong to other work. `own_threads` is the number of the run's
/// own threads.
fn is_oversubscribed(own_threads: usize) -> bool {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    // SAFETY: the call takes and returns a number.
    let cores = unsafe { libc::sysconf(libc::_SC_NPROCESSORS_ONLN) };
    runnable_threads(&text).is_some_and(|runnable_threads| {
        runnable_threads > own_threads
            && i64::try_from(runnable_threads).is_ok_and(|runnable_threads| runnable_threads > cores)
    })
}

/// The number of runnable threads, from a line such as `0.20 0.18 0.12 3/215 4711`.
fn runnable_threads(loadavg: &str) -> Option<usize> {
    loadavg.split_whitespace().nth(3)?.split_once('/')?.0.parse().ok()
}

/// Requests slices of `slice` ns for a process's main thread; process 0 is this thread. Only a hint: kernels before 6.12 ignore it,
/// and a run without it is slower, not different.
fn request_slice(process: u32, slice: u64) {
    let process = process as c_long;
    // SAFETY: all zeros is a value of this plain structure of integers.
    let mut attributes: sched_attr = unsafe { std::mem::zeroed() };
    let size = size_of::<sched_attr>() as u32;
    // SAFETY: the kernel writes at most `size` bytes to a structure that has them.
    let known = unsafe { libc::syscall(SYS_sched_getattr, process, &raw mut attributes, size, 0 as c_long) } == 0;
    let ordinary = [SCHED_OTHER, SCHED_BATCH].contains(&(attributes.sched_policy as i32));
    if known && ordinary {
        attributes.size = size;
        attributes.sched_runtime = slice;
        // SAFETY: the kernel reads a structure whose `size` says how long it is. Policy and niceness are those that it has just
        // returned.
        unsafe { libc::syscall(SYS_sched_setattr, process, &raw const attributes, 0 as c_long) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slice() -> u64 {
        // SAFETY: all zeros is a value of this plain structure of integers.
        let mut attributes: sched_attr = unsafe { std::mem::zeroed() };
        let size = size_of::<sched_attr>() as u32;
        // SAFETY: the kernel writes at most `size` bytes to a structure that has them; process 0 is this thread.
        unsafe { libc::syscall(SYS_sched_getattr, 0 as c_long, &raw mut attributes, size, 0 as c_long) };
        attributes.sched_runtime
    }

    #[test]
    fn time_slice_is_requested_and_reset() {
        let usual = slice();
        request_slice(0, SHORT_NS);
        let short = slice();
        request_slice(0, DEFAULT_NS);
        assert_eq!(slice(), usual);
        // Older kernels ignore the request.
        assert!(short == SHORT_NS || short == usual, "{short} ns, usually {usual} ns");
    }

    #[test]
    fn runnable_threads_are_parsed_from_loadavg() {
        assert_eq!(runnable_threads("0.20 0.18 0.12 3/215 4711\n"), Some(3));
        assert_eq!(runnable_threads("0.20 0.18"), None);
        assert_eq!(runnable_threads(""), None);
    }
}
