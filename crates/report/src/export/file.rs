//! Output files of exports.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tape::ReadError;

use super::error::ExportError;

/// Information about the run for readers of the files: keys and values of their metadata.
pub type Metadata = [(&'static str, String)];

/// Why a file could not be written.
pub(super) enum WriteError {
    Tape(ReadError),
    Io(io::Error),
}

impl From<ReadError> for WriteError {
    fn from(error: ReadError) -> WriteError {
        WriteError::Tape(error)
    }
}

impl From<io::Error> for WriteError {
    fn from(error: io::Error) -> WriteError {
        WriteError::Io(error)
    }
}

/// A file that has a temporary name until it is complete: a partial file never looks like a complete one. If dropped before
/// completion, it is removed.
pub(super) struct PartialFile {
    path: PathBuf,
    part: PathBuf,
    file: BufWriter<File>,
}

impl PartialFile {
    pub(super) fn create(path: PathBuf) -> Result<PartialFile, ExportError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        match File::create(&part) {
            Ok(file) => Ok(PartialFile {
                path,
                part,
                file: BufWriter::with_capacity(1 << 18, file),
            }),
            Err(source) => Err(ExportError::Io {
                path,
                action: "create the file",
                source,
            }),
        }
    }

    pub(super) fn error(&self, action: &'static str) -> impl FnOnce(io::Error) -> ExportError {
        let path = self.path.clone();
        move |source| ExportError::Io { path, action, source }
    }

    pub(super) fn write(
        &mut self,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
    ) -> Result<(), ExportError> {
        match write(&mut self.file) {
            Ok(()) => Ok(()),
            Err(WriteError::Tape(error)) => Err(ExportError::Tape(error)),
            Err(WriteError::Io(error)) => Err(self.error("write the file")(error)),
        }
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        self.write(|file| file.write_all(bytes).map_err(WriteError::Io))
    }

    pub(super) fn finish(mut self) -> Result<PathBuf, ExportError> {
        self.write(|file| file.flush().map_err(WriteError::Io))?;
        fs::rename(&self.part, &self.path).map_err(self.error("name the file"))?;
        Ok(self.path.clone())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // After completion the temporary name no longer exists.
        let _ = fs::remove_file(&self.part);
    }
}

pub(super) fn write_complete_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
) -> Result<(), ExportError> {
    let mut draft = PartialFile::create(path.to_owned())?;
    draft.write(write)?;
    draft.finish().map(|_| ())
}

/// A writer that counts its position.
pub(super) struct CountingWriter<'a, W: Write> {
    inner: &'a mut W,
    pub(super) position: u64,
}

impl<'a, W: Write> CountingWriter<'a, W> {
    pub(super) fn new(inner: &'a mut W) -> CountingWriter<'a, W> {
        CountingWriter { inner, position: 0 }
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.inner.write_all(bytes)
    }
}
