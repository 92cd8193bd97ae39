//! Errors of reports.

use std::path::PathBuf;

use tape::ReadError;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// A file of the run folder cannot be read.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The mistake.
        reason: String,
    },
}
