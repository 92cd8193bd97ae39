//! What is wrong with a view.

/// A mistake in a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The key below the table, its parts separated by dots; entries of a list go by their numbers, from 1.
    pub key: String,
    /// What is wrong with it.
    pub reason: String,
}

impl Mistake {
    pub(crate) fn new(key: String, reason: impl Into<String>) -> Mistake {
        let reason = reason.into();
        Mistake { key, reason }
    }
}
