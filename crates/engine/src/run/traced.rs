//! What became of a trace.

use std::path::PathBuf;

/// What became of a trace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Traced {
    /// The file.
    pub path: PathBuf,
    /// Spans in it.
    pub spans: u64,
    /// Spans that are missing in it.
    pub missing: u64,
    /// Why it is not whole, if it could not be written.
    pub error: Option<String>,
}
