//! Tapes as files that other tools open: CSV, Parquet, MCAP.
//!
//! Every export reads the tape once, in order, and holds a few megabytes whatever its length. A file has its final name
//! only when it is complete.
//!
//! The writers of Parquet and MCAP are our own few hundred lines each. What a tape needs of these formats (columns of
//! numbers without gaps; chunks of messages) is a small corner of them, and the libraries for the whole would more than
//! double what this crate compiles. The readers that users have are the judges: tests open the files with them.

mod columns;
mod csv;
mod mcap;
mod npy;
mod parquet;
mod sheet;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tape::{ReadError, Source};

pub use mcap::Geometry;
pub use sheet::{Cells, Sheet, SheetColumn};

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
}

/// One CSV file per stream into the folder `dir`: `<participant>.<port>.csv`. The first line has the columns' names with
/// their units, numbers are the shortest text that reads back to the same number. Gives the files.
///
/// A field of more than 256 elements, such as a picture, has no place in a table of texts: it is an array of NumPy's in a
/// file beside the table, `<participant>.<port>.<field>.npy`, with the number of samples before its own shape.
pub fn csv(source: &dyn Source, dir: &Path) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, csv::write)
}

/// One Parquet file per stream into the folder `dir`: `<participant>.<port>.parquet`, a column of the field's own type per
/// element. A field of more than 256 elements is one column: bytes of a fixed number for `u8`, a list of a fixed number of
/// elements for the other types. Unit, frame, field and shape of each column are in the column's metadata as Arrow readers
/// show it, and `about` in that of the file, each key behind `escapement.`. Gives the files.
pub fn parquet(source: &dyn Source, dir: &Path, about: &About) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, |source, stream, dir| {
        let path = dir.join(format!("{}.parquet", source.streams()[stream].name()));
        whole_file(&path, |file| parquet::write(source, stream, about, file))?;
        Ok(vec![path])
    })
}

/// How an MCAP file is compressed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Chunk by chunk as an LZ4 frame, which every reader of MCAP knows.
    #[default]
    Lz4,
}

/// What a reader of the files should know of the run: keys and values of their metadata.
pub type About = [(&'static str, String)];

/// One MCAP file with every stream as a topic `/participant/port` of a protobuf message that describes itself, the
/// poses among the fields as frame transforms on `/tf`, and `geometry` as a scene.
///
/// A pose is a pair of fields `p_XY_X` and `quat_XY`: frame Y in frame X. Log times are the stamps as nanoseconds
/// since the start of the run. `about` is the metadata record `escapement`.
pub fn mcap(
    source: &dyn Source,
    path: &Path,
    geometry: Option<&Geometry>,
    about: &About,
    compression: Compression,
) -> Result<(), ExportError> {
    whole_file(path, |file| mcap::write(source, geometry, about, compression, file))
}

/// What writes one file.
enum WriteError {
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

fn per_stream(
    source: &dyn Source,
    dir: &Path,
    write: impl Fn(&dyn Source, usize, &Path) -> Result<Vec<PathBuf>, ExportError>,
) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(dir).map_err(|source| ExportError::Io {
        path: dir.to_owned(),
        action: "create the folder",
        source,
    })?;
    let mut files = Vec::with_capacity(source.streams().len());
    for stream in 0..source.streams().len() {
        files.extend(write(source, stream, dir)?);
    }
    Ok(files)
}

/// A file under another name until it is complete: half a file never looks like a whole one. Dropped before that, it is
/// removed.
struct Draft {
    path: PathBuf,
    part: PathBuf,
    file: BufWriter<File>,
}

impl Draft {
    fn create(path: PathBuf) -> Result<Draft, ExportError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        match File::create(&part) {
            Ok(file) => Ok(Draft {
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

    fn error(&self, action: &'static str) -> impl FnOnce(io::Error) -> ExportError {
        let path = self.path.clone();
        move |source| ExportError::Io { path, action, source }
    }

    fn write(&mut self, write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>) -> Result<(), ExportError> {
        match write(&mut self.file) {
            Ok(()) => Ok(()),
            Err(WriteError::Tape(error)) => Err(ExportError::Tape(error)),
            Err(WriteError::Io(error)) => Err(self.error("write the file")(error)),
        }
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        self.write(|file| file.write_all(bytes).map_err(WriteError::Io))
    }

    fn finish(mut self) -> Result<PathBuf, ExportError> {
        self.write(|file| file.flush().map_err(WriteError::Io))?;
        fs::rename(&self.part, &self.path).map_err(self.error("name the file"))?;
        Ok(self.path.clone())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // Not there any more under this name when it was finished.
        let _ = fs::remove_file(&self.part);
    }
}

fn whole_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
) -> Result<(), ExportError> {
    let mut draft = Draft::create(path.to_owned())?;
    draft.write(write)?;
    draft.finish().map(|_| ())
}

/// A number of variable length, as Thrift and Protocol Buffers have it: seven bits a byte, least significant first.
fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// A writer that knows how far it is.
struct Counted<'a, W: Write> {
    inner: &'a mut W,
    position: u64,
}

impl<'a, W: Write> Counted<'a, W> {
    fn new(inner: &'a mut W) -> Counted<'a, W> {
        Counted { inner, position: 0 }
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.inner.write_all(bytes)
    }
}
