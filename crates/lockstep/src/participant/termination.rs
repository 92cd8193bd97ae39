//! Why a participant's part in a run is over.

/// Why a participant's part in a run is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// The participant has done all of its activations.
    Finished,
    /// The run ends earlier: it was stopped, or the participant or another component has failed.
    Stopped,
    /// Another participant replaces it, and the run continues.
    Replaced,
}

impl Termination {
    /// The name of the reason, the same in every language.
    pub fn name(self) -> &'static str {
        match self {
            Termination::Finished => "finished",
            Termination::Stopped => "stopped",
            Termination::Replaced => "replaced",
        }
    }
}
