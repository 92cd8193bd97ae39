//! Errors of exports.

use std::io;
use std::path::PathBuf;

use tape::ReadError;

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// An error of the file system.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The attempted operation.
        action: &'static str,
        /// The system's message.
        source: io::Error,
    },
    /// A stream exceeds a limit of the format.
    #[error(
        "stream `{stream}` would be a variable of {bytes} bytes, and a MAT file holds less than 2 GiB of each: choose a part of it with --of, --from and --until, or another format"
    )]
    TooLarge {
        /// The stream.
        stream: String,
        /// Its size in the format.
        bytes: u64,
    },
}
