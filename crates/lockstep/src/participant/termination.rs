//! Why a participant's part in a run is over.

/// Why a participant's part in a run is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// It has done all of its activations.
    Finished,
    /// The run ends before that: it was stopped, or something has failed, here or elsewhere.
    Stopped,
    /// Another one takes its place, and the run goes on.
    Replaced,
}

impl Termination {
    /// As every language says it.
    pub fn word(self) -> &'static str {
        match self {
            Termination::Finished => "finished",
            Termination::Stopped => "stopped",
            Termination::Replaced => "replaced",
        }
    }
}
