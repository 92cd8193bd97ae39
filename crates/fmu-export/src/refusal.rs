//! The result of a call of the standard that is rejected.

/// The statuses of the standard, the same numbers in both versions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Executed.
    Ok = 0,
    /// Not executed; the instance is unchanged.
    Discard = 2,
    /// Failed: the instance cannot be used until it is reset or gets another state.
    Error = 3,
}

/// A call that was rejected, with the reason and the remedy.
#[derive(Debug, Clone)]
pub struct Refusal {
    /// [`Status::Discard`] or [`Status::Error`].
    pub status: Status,
    /// For the importer's log.
    pub text: String,
}

impl Refusal {
    /// Not executed, and the instance remains usable.
    pub fn discard(text: impl Into<String>) -> Refusal {
        Refusal {
            status: Status::Discard,
            text: text.into(),
        }
    }

    /// Failed.
    pub fn error(text: impl Into<String>) -> Refusal {
        Refusal {
            status: Status::Error,
            text: text.into(),
        }
    }
}

impl From<String> for Refusal {
    fn from(text: String) -> Refusal {
        Refusal::error(text)
    }
}
