//! What happens when a participant fails, and who takes over.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::types::RunEntry;
use super::{Program, Scenario};

/// What happens when a participant dies, hangs, or breaks the protocol.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum OnFailure {
    /// The run ends.
    #[default]
    Stop,
    /// Everybody goes back to the last checkpoint, the participant in a new process.
    Restart,
    /// Another program takes its place, from afresh, where it had come to.
    Substitute(Program),
}

/// `on-failure = "stop"`, `"restart-from-checkpoint"`, or `{ substitute = { … } }`
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "write \"stop\", \"restart-from-checkpoint\" or { substitute = { exe = \"FILE\" } }"
)]
pub(super) enum OnFailureEntry {
    Named(Named),
    Substitute(Box<SubstituteEntry>),
}

#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Named {
    Stop,
    RestartFromCheckpoint,
}

#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SubstituteEntry {
    pub(super) substitute: RunEntry,
}

impl Default for OnFailureEntry {
    fn default() -> OnFailureEntry {
        OnFailureEntry::Named(Named::Stop)
    }
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Program::Builtin(name) => write!(f, "the builtin `{name}`"),
            // The name alone: what is on a tape must not depend on where a project lies.
            Program::Library { file, participant } => {
                if let Some(participant) = participant {
                    write!(f, "`{participant}` of ")?;
                }
                write!(
                    f,
                    "the library `{}`",
                    file.file_name().unwrap_or_default().to_string_lossy()
                )
            }
            Program::Fmu { file, .. } => {
                write!(
                    f,
                    "the FMU `{}`",
                    file.file_name().unwrap_or_default().to_string_lossy()
                )
            }
            Program::External { exe, .. } => {
                write!(f, "`{}`", exe.file_name().unwrap_or_default().to_string_lossy())
            }
        }
    }
}

impl Scenario {
    /// Whether the run may have to move: for a substitution, or when a participant fails.
    pub fn moves(&self) -> bool {
        let mut policies = self.participants.iter().map(|entry| &entry.on_failure);
        !self.substitutions.is_empty() || policies.any(|policy| *policy != OnFailure::Stop)
    }

    /// Whether anybody is to be restarted when it fails.
    pub fn restarts(&self) -> bool {
        let mut policies = self.participants.iter().map(|entry| &entry.on_failure);
        policies.any(|policy| *policy == OnFailure::Restart)
    }
}
