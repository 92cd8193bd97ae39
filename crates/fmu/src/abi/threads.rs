//! The threads of this process: a library whose code one of them executes must stay mapped.

use std::collections::BTreeSet;

/// The flag of a thread that has begun to exit and executes no code of its own any more (`PF_EXITING`).
const EXITING: u64 = 4;

/// The threads that are alive; `None` where the system does not tell.
pub(super) fn alive() -> Option<BTreeSet<u64>> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let numbers = tasks.map(|task| task.ok()?.file_name().to_str()?.parse().ok());
    numbers.collect()
}

/// Whether a thread that is not one of `before` is alive. Without an answer of the system: yes, because the consequence of a wrong no is a
/// crash.
pub(super) fn any_started_since(before: Option<&BTreeSet<u64>>) -> bool {
    let (Some(before), Some(now)) = (before, alive()) else {
        return true;
    };
    now.difference(before).any(|&thread| !is_exiting(thread))
}

/// Whether a thread is gone, or about to be: one that has been joined is listed for a moment longer.
fn is_exiting(thread: u64) -> bool {
    let Ok(about) = std::fs::read_to_string(format!("/proc/self/task/{thread}/stat")) else {
        return true;
    };
    // The name in parentheses may contain anything; the flags are the seventh value after it.
    let values = about.rsplit_once(')').map(|(_, values)| values);
    let flags = values.and_then(|values| values.split_whitespace().nth(6)?.parse::<u64>().ok());
    flags.is_some_and(|flags| flags & EXITING != 0)
}
