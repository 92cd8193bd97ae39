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
pub fn csv(source: &dyn Source, dir: &Path) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, "csv", csv::write)
}

/// One Parquet file per stream into the folder `dir`: `<participant>.<port>.parquet`, a column of the field's own type per
/// element. Unit, frame and field of each column are in the column's metadata as Arrow readers show it. Gives the files.
pub fn parquet(source: &dyn Source, dir: &Path) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, "parquet", parquet::write)
}

/// One MCAP file with every stream as a topic `/participant/port` of a protobuf message that describes itself, the
/// poses among the fields as frame transforms on `/tf`, and `geometry` as a scene.
///
/// A pose is a pair of fields `p_XY_X` and `quat_XY`: frame Y in frame X. Log times are the stamps as nanoseconds
/// since the start of the run.
pub fn mcap(source: &dyn Source, path: &Path, geometry: Option<&Geometry>) -> Result<(), ExportError> {
    whole_file(path, |file| mcap::write(source, geometry, file))
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

type WriteStream = fn(&dyn Source, usize, &mut BufWriter<File>) -> Result<(), WriteError>;

fn per_stream(
    source: &dyn Source,
    dir: &Path,
    extension: &str,
    write: WriteStream,
) -> Result<Vec<PathBuf>, ExportError> {
    fs::create_dir_all(dir).map_err(|source| ExportError::Io {
        path: dir.to_owned(),
        action: "create the folder",
        source,
    })?;
    let mut files = Vec::with_capacity(source.streams().len());
    for (stream, spec) in source.streams().iter().enumerate() {
        let path = dir.join(format!("{}.{extension}", spec.name()));
        whole_file(&path, |file| write(source, stream, file))?;
        files.push(path);
    }
    Ok(files)
}

/// Writes under another name and renames at the end: half a file never looks like a whole one.
fn whole_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), WriteError>,
) -> Result<(), ExportError> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(".part");
    let draft = PathBuf::from(draft);
    let io = |action: &'static str| {
        let path = path.to_owned();
        move |source| ExportError::Io { path, action, source }
    };
    let file = File::create(&draft).map_err(io("create the file"))?;
    let mut file = BufWriter::with_capacity(1 << 18, file);
    let written = write(&mut file).and_then(|()| file.flush().map_err(WriteError::Io));
    drop(file);
    if let Err(error) = written {
        let _ = fs::remove_file(&draft);
        return Err(match error {
            WriteError::Tape(error) => ExportError::Tape(error),
            WriteError::Io(error) => io("write the file")(error),
        });
    }
    fs::rename(&draft, path).map_err(io("name the file"))
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
