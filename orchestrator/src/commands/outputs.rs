//! Files that a command writes into a run folder on request.

use std::path::PathBuf;

/// Registers `files` as outputs of the run folder, so that a run that replaces this one replaces them too. If that fails, the files are
/// complete nevertheless.
pub fn register_outputs(files: &[PathBuf]) {
    if let Err(error) = tape::folder::record_outputs(files, false) {
        eprintln!("warning: {error}; a run with --force does not replace this folder until its new files are removed");
    }
}
