//! The program that runs as a participant.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

/// The program that runs as a participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Program {
    /// A participant that this program contains.
    Builtin(String),
    /// A participant of a shared library. It is loaded by a host process, which is another instance of this program, or by this
    /// process.
    Library {
        /// The file.
        file: PathBuf,
        /// The name of one of its participants; its only one unless given.
        participant: Option<String>,
    },
    /// An FMU. It is loaded by a host process, which is another instance of this program, or by this process.
    Fmu {
        /// The file.
        file: PathBuf,
        /// The other keys of the `run` table, as TOML.
        options: String,
        /// The aliases of its variables, by which connections may name fields.
        aliases: fmu::Aliases,
    },
    /// An external program.
    External {
        /// The file.
        exe: PathBuf,
        /// Its arguments.
        args: Vec<String>,
        /// The working directory: relative paths among its arguments are relative to it.
        folder: PathBuf,
    },
}

impl Program {
    /// Whether it cannot run in this process.
    pub fn is_external(&self) -> bool {
        matches!(self, Program::External { .. })
    }

    /// Its file, unless it is a part of this program.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Program::Builtin(_) => None,
            Program::Library { file, .. } | Program::Fmu { file, .. } | Program::External { exe: file, .. } => {
                Some(file)
            }
        }
    }

    /// The field or element of `port` that `name` means: an alias of an FMU's variable means the field with the variable's name.
    pub(super) fn field<'a>(&self, port: &str, name: &'a str) -> Cow<'a, str> {
        let field = match self {
            Program::Fmu { aliases, .. } => aliases.field(port, name),
            Program::Builtin(_) | Program::Library { .. } | Program::External { .. } => None,
        };
        field.map_or(Cow::Borrowed(name), Cow::Owned)
    }

    /// The key of a `run` table for the `file` of a command line: a library and an FMU are recognised by their extensions.
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
            // Only the name: the content of a tape must not depend on where a project is stored.
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

pub(super) fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file() && metadata.permissions().mode() & 0o111 != 0)
}

/// The file in `PATH` that a bare name refers to.
pub fn in_path(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .map(|folder| folder.join(name))
        .find(|path| is_executable(path))
}
