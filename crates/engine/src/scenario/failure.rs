//! Failure policies: what happens when a participant fails, and what replaces it.

use super::program::Program;

/// What happens when a participant dies, hangs, or breaks the protocol.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum OnFailure {
    /// The run ends.
    #[default]
    Stop,
    /// All participants go back to the last checkpoint, the failed one in a new process.
    Restart,
    /// Another program replaces it with a cold start, at the activation that it had reached.
    Substitute(Program),
}
