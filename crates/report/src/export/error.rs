//! Why an export failed.

use std::io;
use std::path::PathBuf;

use tape::ReadError;

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// A stream does not go into the format.
    #[error(
        "stream `{stream}` would be a variable of {bytes} bytes, and a MAT file holds less than 2 GiB of each: choose a part of it with --of, --from and --until, or another format"
    )]
    TooLarge {
        /// The stream.
        stream: String,
        /// What it would take.
        bytes: u64,
    },
}
