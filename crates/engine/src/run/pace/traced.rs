//! The summary of a trace: the file, the number of its spans, and what is missing.

use std::path::PathBuf;

/// The result of a trace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceSummary {
    /// The file.
    pub path: PathBuf,
    /// Spans in it.
    pub spans: u64,
    /// The number of missing spans.
    pub missing: u64,
    /// Why the file is incomplete, if it could not be written.
    pub error: Option<String>,
}
