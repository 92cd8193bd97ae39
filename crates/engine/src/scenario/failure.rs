//! What happens when a participant fails, and who takes over.

use super::program::Program;

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
