//! Errors of invalid distributions.

/// A distribution that does not exist.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Impossible {
    /// The invalid parameter, by its name in [`Scalar`](super::Scalar) and the other distributions.
    pub parameter: &'static str,
    /// The reason.
    pub reason: String,
}

pub(super) fn impossible(parameter: &'static str, reason: impl Into<String>) -> Impossible {
    Impossible {
        parameter,
        reason: reason.into(),
    }
}
