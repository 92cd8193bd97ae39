//! Files that the user has had written into a run folder under names of the user's choice: a trace, a report, figures, an export.
//!
//! They are noted in the folder with their size and time, so that a run that replaces this one can tell them from the user's own files,
//! which it never removes.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::place::{FolderError, RunFolder, io_error};

/// The file with the notes.
pub(super) const NOTES: &str = "outputs.json";

/// The files below a run folder that were written on request, by their paths in it.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Outputs(BTreeMap<String, Option<Version>>);

/// How a file was left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Version {
    bytes: u64,
    modified_s: i64,
    modified_ns: i64,
}

impl Version {
    fn of(about: &Metadata) -> Version {
        Version {
            bytes: about.len(),
            modified_s: about.mtime(),
            modified_ns: about.mtime_nsec(),
        }
    }
}

impl Outputs {
    /// The notes of the folder `root`; none where they cannot be read, and then every file is the user's.
    pub(super) fn read(root: &Path) -> Outputs {
        let text = fs::read_to_string(root.join(NOTES)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Why the entry `name` of `root` is not, or not only, what was noted; `None` if it is.
    pub(super) fn foreign(&self, root: &Path, name: &str) -> Option<String> {
        let unknown = || Some(format!("`{name}` in it does not belong to a run"));
        let path = root.join(name);
        let Ok(about) = fs::symlink_metadata(&path) else {
            return unknown();
        };
        if !about.is_dir() {
            return match self.0.get(name) {
                Some(noted) if about.is_file() => {
                    let changed = noted.is_some_and(|noted| noted != Version::of(&about));
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
            if let Some(reason) = self.foreign(root, &format!("{name}/{inner}")) {
                return Some(reason);
            }
        }
        if empty { unknown() } else { None }
    }
}

/// Notes `files`, which were just written; with `begun` they are still being written, and may change. Files outside of run folders are
/// not noted.
///
/// # Errors
/// When the notes cannot be written: the files are complete nevertheless, but a later run does not replace the folder.
pub fn note_outputs(files: &[PathBuf], begun: bool) -> Result<(), FolderError> {
    let mut noted: BTreeMap<PathBuf, Outputs> = BTreeMap::new();
    for file in files {
        // A pipe has no path.
        let Ok(path) = fs::canonicalize(file) else { continue };
        let root = path.ancestors().skip(1).find(|folder| RunFolder::is_at(folder));
        let Some((root, below)) = root.and_then(|root| Some((root, path.strip_prefix(root).ok()?.to_str()?))) else {
            continue;
        };
        let about = fs::metadata(&path).map_err(io_error(&path, "find the file"))?;
        let version = (!begun).then(|| Version::of(&about));
        let outputs = noted.entry(root.to_owned()).or_insert_with(|| Outputs::read(root));
        outputs.0.insert(below.to_owned(), version);
    }
    for (root, outputs) in noted {
        let folder = RunFolder::open(&root);
        folder.write_json(&root.join(NOTES), &outputs)?;
    }
    Ok(())
}
