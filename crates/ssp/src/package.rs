//! The files of a package.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use fmu::{Archive, ZipError};

/// The files of a package, by their names inside it.
#[derive(Debug)]
pub enum Package {
    /// In an archive.
    Archive(Archive),
    /// Unpacked.
    Folder(PathBuf),
    /// In memory.
    Files(BTreeMap<String, Vec<u8>>),
}

impl Package {
    /// Whether there is a file of this name.
    pub fn has(&self, name: &str) -> bool {
        match self {
            Package::Archive(archive) => archive.has(name),
            Package::Folder(folder) => folder.join(name).is_file(),
            Package::Files(files) => files.contains_key(name),
        }
    }

    /// The contents of the file of this name, if there is one.
    pub fn file(&self, name: &str) -> Option<Result<Vec<u8>, ZipError>> {
        match self {
            Package::Archive(archive) => archive.file(name),
            Package::Folder(folder) => {
                let path = folder.join(name);
                let read = path.is_file().then(|| fs::read(&path));
                read.map(|read| read.map_err(|source| ZipError::Io { path, source }))
            }
            Package::Files(files) => files.get(name).cloned().map(Ok),
        }
    }
}
