//! The state of a process as the kernel reports it.

/// Whether a process is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Life {
    Alive,
    InKernel,
    Stopped,
    Ended,
}

impl Life {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Life::Alive => "alive",
            Life::InKernel => "alive, in the kernel",
            Life::Stopped => "stopped by a signal or a debugger",
            Life::Ended => "ended",
        }
    }
}

/// The state of the process `pid` as the kernel reports it.
pub(crate) fn life(pid: u32) -> Life {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The state is the first letter after the name, which is in parentheses and may contain anything.
    match stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next()) {
        Some('T' | 't') => Life::Stopped,
        Some('D') => Life::InKernel,
        Some('Z') | None => Life::Ended,
        Some(_) => Life::Alive,
    }
}
