//! Verification of a tape against its seal, for commands that read tapes.

use std::path::Path;

use clap::Args;
use tape::{ReadError, Reader};

use crate::line::Busy;

/// Whether the command accepts a tape that differs from its seal.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct SealArgs {
    /// Read the tape even if it differs from its seal, with a warning
    #[arg(long)]
    pub unverified: bool,
}

impl SealArgs {
    /// Opens the tape in `folder`, and compares it with its seal.
    ///
    /// # Errors
    /// Unreadable files, and a difference from the seal; with `--unverified` a difference is a warning.
    pub fn open(self, folder: &Path) -> Result<Reader, ReadError> {
        let reader = Reader::open(folder)?;
        let _busy = Busy::reading("comparing with its seal:", folder);
        match reader.verify() {
            Err(error) if self.unverified => eprintln!("warning: {error}"),
            verified => verified?,
        }
        Ok(reader)
    }
}

/// Names the streams that end in an incomplete record, which every command leaves out.
pub fn warn_incomplete_records(tape: &Reader) {
    for torn in tape.incomplete_records() {
        eprintln!(
            "note: stream `{}` ends in an incomplete record, which is left out",
            torn.stream
        );
    }
}

/// The text of an error of a command that has `--unverified`.
pub fn read_error_text(error: &ReadError) -> String {
    match error {
        ReadError::Altered { .. } => format!("{error} (--unverified reads it as it is)"),
        other => other.to_string(),
    }
}
