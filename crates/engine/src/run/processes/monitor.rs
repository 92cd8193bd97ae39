//! Supervision of all participants while the orchestrator waits for one of them.

use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

use rustix::process::{WaitId, WaitIdOptions, waitid};

use super::child::ParticipantProcess;
use super::resources;
use crate::observer::Interrupt;
use crate::run::log::{Log, full_log_reason, tail_message};
use crate::run::outcome::RunFailure;

/// The reasons to end a wait early: a signal from the user, or the failure of a participant.
pub(crate) struct Monitor {
    interrupt: Interrupt,
    processes: Vec<MonitoredProcess>,
}

/// A monitored participant.
struct MonitoredProcess {
    name: String,
    pid: u32,
    process: OwnedFd,
    log: Log,
}

impl Monitor {
    /// A monitor of the user's signals alone.
    pub(crate) fn new(interrupt: Interrupt) -> Monitor {
        let processes = Vec::new();
        Monitor { interrupt, processes }
    }

    /// A monitor of the user's signals and of `processes`.
    pub(crate) fn monitoring<'a>(
        &self,
        processes: impl Iterator<Item = &'a ParticipantProcess>,
    ) -> std::io::Result<Monitor> {
        let watch = |process: &ParticipantProcess| {
            Ok(MonitoredProcess {
                name: process.name.clone(),
                pid: process.pid(),
                process: process.descriptor().try_clone_to_owned()?,
                log: process.log().clone(),
            })
        };
        Ok(Monitor {
            interrupt: self.interrupt.clone(),
            processes: processes.map(watch).collect::<std::io::Result<_>>()?,
        })
    }

    /// The name and the process number of each monitored participant.
    pub(crate) fn participants(&self) -> impl Iterator<Item = (&str, u32)> {
        self.processes.iter().map(|one| (one.name.as_str(), one.pid))
    }

    /// Whether the user requested the end of the run.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.interrupt.is_requested()
    }

    /// The signal or the failure that makes waiting pointless, if there is one.
    pub(crate) fn failure(&self) -> Option<RunFailure> {
        if self.is_interrupted() {
            return Some(RunFailure::Interrupted);
        }
        self.processes.iter().find_map(|one| {
            let reason = match (one.exit_status(), one.log.is_full()) {
                (Some(status), _) => {
                    one.log.wait_complete();
                    let ending = ParticipantProcess::describe_exit(status);
                    let memory = resources::bus_error_hint(status);
                    format!("{ending} before the run began{memory}{}", tail_message(&one.log))
                }
                (None, true) => full_log_reason(),
                (None, false) => return None,
            };
            let participant = one.name.clone();
            Some(RunFailure::Participant { participant, reason })
        })
    }
}

impl MonitoredProcess {
    /// The exit status of the process, if it has ended. The participant's own handle still collects it.
    fn exit_status(&self) -> Option<ExitStatus> {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        let status = waitid(WaitId::PidFd(self.process.as_fd()), options).ok()??;
        // In the format of `wait`: a signal in the low bits, an exit code above them.
        let raw = match (status.exit_status(), status.terminating_signal()) {
            (Some(code), _) => code << 8,
            (None, signal) => signal.unwrap_or_default(),
        };
        Some(ExitStatus::from_raw(raw))
    }
}
