//! How soon the kernel gives a run's processes a core when the machine is busy with something else.

use libc::{SCHED_BATCH, SCHED_OTHER, SYS_sched_getattr, SYS_sched_setattr, c_long, sched_attr};

/// The slice of processor time that a run's processes ask for, ns: the shortest that the kernel grants.
const SLICE_NS: u64 = 100_000;

/// Asks for short slices of processor time, for this thread and for all that it starts from now on.
///
/// A run's processes hand work to each other every few microseconds. With slices of the kernel's usual 3 ms, each hand-over on a busy
/// machine may wait until somebody else's slice is over. Who asks for shorter slices gets the core sooner and no more of it: the
/// share is that of any other process, so no privilege is needed. A hint: kernels before 6.12 take no notice, and without it a
/// run is slower, not different.
pub(super) fn ask_for_short_ones() {
    // SAFETY: all zeros is a value of this plain structure of integers.
    let mut attributes: sched_attr = unsafe { std::mem::zeroed() };
    let size = size_of::<sched_attr>() as u32;
    // SAFETY: the kernel writes at most `size` bytes to a structure that has them; 0 is this thread.
    let known = unsafe { libc::syscall(SYS_sched_getattr, 0 as c_long, &raw mut attributes, size, 0 as c_long) } == 0;
    let ordinary = [SCHED_OTHER, SCHED_BATCH].contains(&(attributes.sched_policy as i32));
    if known && ordinary {
        attributes.size = size;
        attributes.sched_runtime = SLICE_NS;
        // SAFETY: the kernel reads a structure whose `size` says how long it is. Policy and niceness are those it just gave.
        unsafe { libc::syscall(SYS_sched_setattr, 0 as c_long, &raw const attributes, 0 as c_long) };
    }
}
