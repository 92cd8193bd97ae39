//! The state of a process as the kernel reports it.

/// Whether a process is alive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ProcessState {
    Alive,
    InKernel,
    Stopped,
    Ended,
}

impl ProcessState {
    pub(crate) fn description(self) -> &'static str {
        match self {
            ProcessState::Alive => "alive",
            ProcessState::InKernel => "alive, in the kernel",
            ProcessState::Stopped => "stopped by a signal or a debugger",
            ProcessState::Ended => "ended",
        }
    }
}

/// The state of the process `pid` as the kernel reports it.
pub(crate) fn process_state(pid: u32) -> ProcessState {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The state is the first letter after the name, which is in parentheses and may contain anything.
    match stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next()) {
        Some('T' | 't') => ProcessState::Stopped,
        Some('D') => ProcessState::InKernel,
        Some('Z') | None => ProcessState::Ended,
        Some(_) => ProcessState::Alive,
    }
}
