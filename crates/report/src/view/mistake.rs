//! Mistakes in a view, with the key of the scenario where each is.

/// A mistake in a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The key in the table, its parts separated by dots; entries of a list are addressed by number, from 1.
    pub key: String,
    /// The description of the mistake.
    pub reason: String,
}

impl Mistake {
    pub(crate) fn new(key: String, reason: impl Into<String>) -> Mistake {
        let reason = reason.into();
        Mistake { key, reason }
    }
}
