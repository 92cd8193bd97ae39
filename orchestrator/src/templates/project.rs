//! A template, and the files that it makes of a project.

use std::path::PathBuf;

pub use crate::commands::project::File;

/// A project that can be written.
pub struct Template {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Whether it has to be built, against Escapement's own sources.
    pub builds: bool,
    /// Whether it takes files that the user names.
    pub takes_files: bool,
    /// The files.
    pub files: fn(&Project<'_>) -> Result<Vec<File>, String>,
    /// What to do in its folder, each a line for a shell.
    pub next: &'static [&'static str],
}

/// What is known of a project before it is written.
#[cfg_attr(
    not(feature = "capture"),
    expect(dead_code, reason = "only templates of the stock program look at it")
)]
pub struct Project<'a> {
    /// The name of its folder.
    pub name: String,
    /// Where Escapement's sources are, where the user says so.
    pub escapement: Option<&'a str>,
    /// The files that the user names.
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
