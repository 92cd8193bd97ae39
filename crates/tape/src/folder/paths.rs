//! The paths of a run's files in its folder.

use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use serde::Serialize;

/// A run folder that exists.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    pub(super) root: PathBuf,
}

/// Why a run folder cannot be created or written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder is not empty.
    #[error("{} is not empty: name a new folder with `--out`; `--force` replaces what is in it, if that is a run", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The content of the folder is not a run, or not only a run.
    #[error("{} is not replaced: {reason}; name a new folder with `--out`", path.display())]
    NotARun {
        /// The folder.
        path: PathBuf,
        /// What is there, or is missing.
        reason: String,
    },
    /// There is an entry of that name that is not a folder.
    #[error("{} is not a folder: name a new one with `--out`", path.display())]
    NotAFolder {
        /// The path.
        path: PathBuf,
    },
    /// The file system returned an error.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operation.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },
}

pub(super) fn io_error(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    move |source| FolderError::Io { path, action, source }
}

/// Creates folders that only the user can access, whatever the user's umask is: the owner decides whether others may read the files of a
/// run.
pub fn private_dir_builder() -> DirBuilder {
    let mut builder = DirBuilder::new();
    builder.mode(0o700);
    builder
}

/// The files that every run folder has from the beginning. The last of them is the last entry that is set aside when a run is replaced, and
/// the first that is restored: a folder that has it contains a complete run.
pub const REQUIRED_FILES: [&str; 2] = ["run.json", "plan.toml"];

/// The entries of a run folder that are the record of the run. An export and a report are not among them: they can be created again.
pub const RUN_ENTRIES: [&str; 7] = [
    "plan.toml",
    "run.json",
    "summary.json",
    "log",
    "tape",
    "checkpoints",
    "shadow",
];

/// The first file that `folder` lacks to be the folder of a run.
pub(super) fn missing_required_file(folder: &Path) -> Option<&'static str> {
    let file = |name: &str| std::fs::symlink_metadata(folder.join(name)).is_ok_and(|about| about.is_file());
    REQUIRED_FILES.into_iter().rev().find(|name| !file(name))
}

impl RunFolder {
    /// Whether `folder` is the folder of a run.
    pub(super) fn is_at(folder: &Path) -> bool {
        missing_required_file(folder).is_none()
    }

    /// Takes a folder unchanged; it may be empty.
    pub fn open(root: &Path) -> RunFolder {
        RunFolder { root: root.to_owned() }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The scenario with every default filled in.
    pub fn plan(&self) -> PathBuf {
        self.root.join("plan.toml")
    }

    /// Versions, host, command line, files.
    pub fn run(&self) -> PathBuf {
        self.root.join("run.json")
    }

    /// The instant from which its plan is that of the run, according to `run.json`: a run that was resumed with changes had another plan
    /// before. From the beginning when there is no value.
    pub fn changed_at(&self) -> Option<String> {
        self.run_json_text("changed_at")
    }

    /// The name of the scenario, according to `run.json`.
    pub fn scenario_name(&self) -> Option<String> {
        self.run_json_text("scenario")
    }

    fn run_json_text(&self, key: &str) -> Option<String> {
        let text = crate::read_regular(&self.run()).ok()?;
        let about: serde_json::Value = serde_json::from_slice(&text).ok()?;
        Some(about.get(key)?.as_str()?.to_owned())
    }

    /// Verdict and figures of merit.
    pub fn summary(&self) -> PathBuf {
        self.root.join("summary.json")
    }

    /// The tape's folder; [`crate::Writer::create`] creates it.
    pub fn tape(&self) -> PathBuf {
        self.root.join("tape")
    }

    /// The folder of the checkpoints; it exists once there is a checkpoint.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }

    /// The file for a participant's standard error.
    pub fn stderr(&self, participant: &str) -> PathBuf {
        self.root.join("log").join(format!("{participant}.stderr"))
    }

    /// Writes `text` to `path`, a path of this folder, atomically.
    pub fn write(&self, path: &Path, text: &str) -> Result<(), FolderError> {
        crate::write_atomic(path, text).map_err(io_error(path, "write the file"))
    }

    /// Writes `content` as indented JSON, like [`RunFolder::write`].
    pub fn write_json(&self, path: &Path, content: &impl Serialize) -> Result<(), FolderError> {
        let mut text = serde_json::to_string_pretty(content)
            .map_err(io::Error::from)
            .map_err(io_error(path, "put the content into JSON"))?;
        text.push('\n');
        self.write(path, &text)
    }
}
