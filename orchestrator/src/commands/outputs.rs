//! Files that a command writes into a run folder on request.

use std::path::PathBuf;

/// Notes `files`, so that a run that replaces this one replaces them too. Where this fails they are complete nevertheless.
pub fn note(files: &[PathBuf]) {
    if let Err(error) = tape::folder::record_outputs(files, false) {
        eprintln!("warning: {error}; a run with --force does not replace this folder until its new files are removed");
    }
}
