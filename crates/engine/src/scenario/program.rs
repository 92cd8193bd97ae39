//! The program that runs in a participant's place.

use std::fmt;
use std::path::{Path, PathBuf};

/// What runs in a participant's place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Program {
    /// A participant that this program contains.
    Builtin(String),
    /// A participant of a shared library. A host process, which is this program started once more, loads it; or this process does.
    Library {
        /// The file.
        file: PathBuf,
        /// Which of its participants; the only one unless given.
        participant: Option<String>,
    },
    /// An FMU. A host process, which is this program started once more, loads it; or this process does.
    Fmu {
        /// The file.
        file: PathBuf,
        /// The keys beside it, as TOML.
        options: String,
    },
    /// A program of its own.
    External {
        /// The file.
        exe: PathBuf,
        /// Its arguments.
        args: Vec<String>,
        /// The folder in which it is started: relative paths among its arguments are relative to it.
        folder: PathBuf,
    },
}

impl Program {
    /// Whether it cannot run in this process.
    pub fn is_external(&self) -> bool {
        matches!(self, Program::External { .. })
    }

    /// The file that it consists of, if it is not a part of this program.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Program::Builtin(_) => None,
            Program::Library { file, .. } | Program::Fmu { file, .. } | Program::External { exe: file, .. } => {
                Some(file)
            }
        }
    }

    /// The key of a `run` table under which the command line's `file` stands: a library and an FMU by their endings.
    pub fn key_of(file: &str) -> &'static str {
        match Path::new(file).extension().and_then(|ending| ending.to_str()) {
            Some("so") => "library",
            Some("fmu") => "fmu",
            _ => "exe",
        }
    }
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Program::Builtin(name) => write!(f, "the builtin `{name}`"),
            // The name alone: what is on a tape must not depend on where a project lies.
            Program::Library { file, participant } => {
                if let Some(participant) = participant {
                    write!(f, "`{participant}` of ")?;
                }
                write!(
                    f,
                    "the library `{}`",
                    file.file_name().unwrap_or_default().to_string_lossy()
                )
            }
            Program::Fmu { file, .. } => {
                write!(
                    f,
                    "the FMU `{}`",
                    file.file_name().unwrap_or_default().to_string_lossy()
                )
            }
            Program::External { exe, .. } => {
                write!(f, "`{}`", exe.file_name().unwrap_or_default().to_string_lossy())
            }
        }
    }
}

pub(super) fn runs(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(path).is_ok_and(|about| about.is_file() && about.permissions().mode() & 0o111 != 0)
}

/// The file that a bare name stands for.
pub fn in_path(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .map(|folder| folder.join(name))
        .find(|path| runs(path))
}
