//! Why there is no such distribution.

/// A distribution that there is not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Impossible {
    /// The parameter that is wrong, as [`Scalar`](super::Scalar) and the others call it.
    pub parameter: &'static str,
    /// What is wrong with it.
    pub reason: String,
}

pub(super) fn impossible(parameter: &'static str, reason: impl Into<String>) -> Impossible {
    Impossible {
        parameter,
        reason: reason.into(),
    }
}
