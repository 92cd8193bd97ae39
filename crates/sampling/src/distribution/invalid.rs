//! Errors of invalid distributions.

/// Why a distribution is invalid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InvalidParameter {
    /// The invalid parameter, by its name in [`Scalar`](super::Scalar) and the other distributions.
    pub parameter: &'static str,
    /// The reason.
    pub reason: String,
}

pub(super) fn invalid(parameter: &'static str, reason: impl Into<String>) -> InvalidParameter {
    InvalidParameter {
        parameter,
        reason: reason.into(),
    }
}
