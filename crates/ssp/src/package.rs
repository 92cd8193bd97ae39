//! The files of a package.

use std::collections::BTreeMap;

use fmu::{Archive, ZipError};

/// The files of a package, by their names inside it.
#[derive(Debug)]
pub enum Package {
    /// In an archive.
    Archive(Archive),
    /// As they are.
    Files(BTreeMap<String, Vec<u8>>),
}

impl Package {
    /// Whether there is a file of this name.
    pub fn has(&self, name: &str) -> bool {
        match self {
            Package::Archive(archive) => archive.has(name),
            Package::Files(files) => files.contains_key(name),
        }
    }

    /// The contents of the file of this name, if there is one.
    pub fn file(&self, name: &str) -> Option<Result<Vec<u8>, ZipError>> {
        match self {
            Package::Archive(archive) => archive.file(name),
            Package::Files(files) => files.get(name).cloned().map(Ok),
        }
    }
}
