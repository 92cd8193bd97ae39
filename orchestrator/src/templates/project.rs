//! Templates, and the files that they create in a project.

use std::path::PathBuf;

pub use crate::commands::project::File;

/// A template of a project.
pub struct Template {
    /// Its name.
    pub name: &'static str,
    /// Its description, in a line.
    pub about: &'static str,
    /// Whether it has to be compiled, with Escapement's own sources.
    pub builds: bool,
    /// Whether it takes files from the user.
    pub takes_files: bool,
    /// The files.
    pub files: fn(&Project<'_>) -> Result<Vec<File>, String>,
    /// The next commands in its folder, each a shell command line.
    pub next: &'static [&'static str],
}

/// The data of a project before it is written.
#[cfg_attr(
    not(feature = "capture"),
    expect(dead_code, reason = "only templates of the stock program look at it")
)]
pub struct Project<'a> {
    /// The name of its folder.
    pub name: String,
    /// The path of Escapement's sources, where the user gives it.
    pub escapement: Option<&'a str>,
    /// The user's files.
    pub files: &'a [PathBuf],
}

#[cfg(feature = "capture")]
impl File {
    pub(super) fn new(path: &str, text: impl Into<String>) -> File {
        File {
            path: path.to_owned(),
            contents: text.into().into_bytes(),
        }
    }
}
