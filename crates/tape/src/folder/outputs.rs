//! Files that the user has had written into a run folder under names of the user's choice: a trace, a report, figures, an export.
//!
//! They are recorded in the folder with their size and time, so that a run that replaces this one can tell them from the user's own files,
//! which it never removes.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::paths::{FolderError, RunFolder, io_error};

/// The file that lists the outputs.
pub const OUTPUTS_FILE: &str = "outputs.json";

/// The files below a run folder that were written on request, by their paths in it.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Outputs(BTreeMap<String, Option<FileVersion>>);

/// The size and time of a file when it was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct FileVersion {
    bytes: u64,
    modified_s: i64,
    modified_ns: i64,
}

impl FileVersion {
    fn of(about: &Metadata) -> FileVersion {
        FileVersion {
            bytes: about.len(),
            modified_s: about.mtime(),
            modified_ns: about.mtime_nsec(),
        }
    }
}

impl Outputs {
    /// The recorded outputs of the folder `root`; none where they cannot be read, and then every file is the user's.
    pub(super) fn read(root: &Path) -> Outputs {
        let text = fs::read_to_string(root.join(OUTPUTS_FILE)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Why the entry `name` of `root` is not, or not only, a recorded output; `None` if it is.
    pub(super) fn foreign_reason(&self, root: &Path, name: &str) -> Option<String> {
        let unknown = || Some(format!("`{name}` in it does not belong to a run"));
        let path = root.join(name);
        let Ok(about) = fs::symlink_metadata(&path) else {
            return unknown();
        };
        if !about.is_dir() {
            return match self.0.get(name) {
                Some(recorded) if about.is_file() => {
                    let changed = recorded.is_some_and(|recorded| recorded != FileVersion::of(&about));
                    changed.then(|| format!("`{name}` in it was changed after this program had written it"))
                }
                _ => unknown(),
            };
        }
        let Ok(entries) = fs::read_dir(&path) else {
            return unknown();
        };
        let mut empty = true;
        for entry in entries {
            empty = false;
            let inner = entry.ok().and_then(|entry| entry.file_name().into_string().ok());
            let Some(inner) = inner else { return unknown() };
            if let Some(reason) = self.foreign_reason(root, &format!("{name}/{inner}")) {
                return Some(reason);
            }
        }
        if empty { unknown() } else { None }
    }
}

/// Records `files`, which were just written; with `begun` they are still being written, and may change. Files outside of run folders are
/// not recorded.
///
/// # Errors
/// When the list cannot be written: the files are complete nevertheless, but a later run does not replace the folder.
pub fn record_outputs(files: &[PathBuf], begun: bool) -> Result<(), FolderError> {
    let mut recorded: BTreeMap<PathBuf, Outputs> = BTreeMap::new();
    for file in files {
        // A pipe has no path.
        let Ok(path) = fs::canonicalize(file) else { continue };
        let root = path.ancestors().skip(1).find(|folder| RunFolder::is_at(folder));
        let Some((root, relative)) = root.and_then(|root| Some((root, path.strip_prefix(root).ok()?.to_str()?))) else {
            continue;
        };
        let about = fs::metadata(&path).map_err(io_error(&path, "find the file"))?;
        let version = (!begun).then(|| FileVersion::of(&about));
        let outputs = recorded.entry(root.to_owned()).or_insert_with(|| Outputs::read(root));
        outputs.0.insert(relative.to_owned(), version);
    }
    for (root, outputs) in recorded {
        let folder = RunFolder::open(&root);
        folder.write_json(&root.join(OUTPUTS_FILE), &outputs)?;
    }
    Ok(())
}
