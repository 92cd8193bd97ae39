//! FMU files: archive and description. None of the code is executed.

use std::path::{Path, PathBuf};

use crate::description::{Description, DescriptionError, Version};
use crate::zip::{Archive, ZipError};

/// Maximum size of an FMU, bytes: 1 GiB.
pub const FILE_MAX: u64 = 1 << 30;

/// Why a file cannot be used as an FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// It cannot be read.
    #[error("`{}`: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It is too large.
    #[error("`{}` has {size} bytes; at most {FILE_MAX} are read", .path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Its size, bytes.
        size: u64,
    },
    /// Its archive is rejected.
    #[error("`{}`: {source}", .path.display())]
    Zip {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ZipError,
    },
    /// Its description is rejected.
    #[error("`{}`: {source}", .path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// Why.
        source: DescriptionError,
    },
    /// A part is missing.
    #[error("`{}`: {reason}", .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The missing part.
        reason: String,
    },
}

/// An FMU.
#[derive(Debug)]
pub struct Model {
    /// The file.
    pub file: PathBuf,
    /// Its contents.
    pub archive: Archive,
    /// Its description.
    pub description: Description,
}

impl Model {
    /// Reads a file.
    ///
    /// # Errors
    /// When it is not an FMU, or one that no machine can use.
    pub fn open(file: &Path) -> Result<Model, FmuError> {
        let path = || file.to_owned();
        let io = |source| FmuError::Io { path: path(), source };
        let about = std::fs::metadata(file).map_err(io)?;
        if !about.is_file() {
            let reason = "it is not a file: an FMU is a ZIP archive whose name ends with .fmu".to_owned();
            return Err(FmuError::Missing { path: path(), reason });
        }
        if about.len() > FILE_MAX {
            let size = about.len();
            return Err(FmuError::Size { path: path(), size });
        }
        Model::read(path(), std::fs::read(file).map_err(io)?)
    }

    /// Reads the contents of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// As for [`Model::open`].
    pub fn read(file: PathBuf, bytes: Vec<u8>) -> Result<Model, FmuError> {
        let path = || file.clone();
        let zip = |source| FmuError::Zip { path: path(), source };
        let archive = Archive::read(bytes).map_err(zip)?;
        let text = archive.file("modelDescription.xml").ok_or_else(|| FmuError::Missing {
            path: path(),
            reason: "it has no modelDescription.xml: it is an archive, but no FMU".into(),
        })?;
        let text = String::from_utf8(text.map_err(zip)?).map_err(|_| FmuError::Missing {
            path: path(),
            reason: "its modelDescription.xml is not UTF-8".into(),
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let description = Description::read(text).map_err(|source| FmuError::Description { path: path(), source })?;
        Ok(Model {
            file,
            archive,
            description,
        })
    }

    /// The folder below `binaries` for this machine.
    pub const fn platform(&self) -> &'static str {
        match self.description.version {
            Version::Fmi2 => "linux64",
            Version::Fmi3 => "x86_64-linux",
        }
    }

    /// The platforms for which it has libraries, and `sources` where it has those.
    pub fn platforms(&self) -> Vec<&str> {
        let mut found: Vec<&str> = Vec::new();
        for entry in self.archive.entries() {
            let platform = match entry
                .name
                .strip_prefix("binaries/")
                .and_then(|rest| rest.split_once('/'))
            {
                Some((platform, rest)) if !rest.is_empty() => platform,
                _ if entry.name.starts_with("sources/") && !entry.name.ends_with('/') => "sources",
                _ => continue,
            };
            if !found.contains(&platform) {
                found.push(platform);
            }
        }
        found
    }

    /// The library for this machine, as a path inside the archive.
    ///
    /// # Errors
    /// When there is none, with the platforms for which there is one.
    pub fn library(&self) -> Result<String, FmuError> {
        let identifier = &self.description.capabilities.identifier;
        let name = format!("binaries/{}/{identifier}.so", self.platform());
        if self.archive.has(&name) {
            return Ok(name);
        }
        let platforms = self.platforms();
        let there = if platforms.is_empty() {
            "no platform at all".to_owned()
        } else {
            platforms.join(", ")
        };
        Err(FmuError::Missing {
            path: self.file.clone(),
            reason: format!(
                "it has no `{name}` for this machine; it is made for {there}; export it for Linux on x86-64"
            ),
        })
    }
}
