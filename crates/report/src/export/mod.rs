//! Tapes as files that other tools open: CSV, Parquet, MAT, MCAP.
//!
//! Every export reads the tape once, in order, and holds a few megabytes whatever its length. A file has its final name
//! only when it is complete.
//!
//! The writers of Parquet, MAT and MCAP are our own few hundred lines each. What a tape needs of these formats (columns of
//! numbers without gaps; chunks of messages) is a small corner of them, and the libraries for the whole would more than
//! double what this crate compiles. The readers that users have are the judges: tests open the files with them.

mod columns;
mod csv;
mod error;
mod file;
mod mat;
mod mcap;
mod npy;
mod parquet;
mod sheet;
mod sheet_files;
mod varint;

use std::fs;
use std::path::{Path, PathBuf};

use tape::Source;

use crate::scene::Scene;
pub use error::ExportError;
pub use file::About;
use file::whole_file;
pub use mcap::Compression;
pub use sheet::{Cells, Sheet, SheetColumn};

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

/// One MAT file of version 5 with a struct per stream, `participant_port`: the stamps as `t`, an array per field of the field's own type,
/// with the samples along the first extent (along the last one for fields of more than 256 elements), `info` with name, unit and frame of
/// each field, and the stream's name as `stream`. Names that MATLAB does not allow are changed. `about` is the struct `escapement`.
pub fn mat(source: &dyn Source, path: &Path, about: &About) -> Result<(), ExportError> {
    if let Some((stream, bytes)) = mat::too_large(source) {
        return Err(ExportError::TooLarge { stream, bytes });
    }
    whole_file(path, |file| mat::write(source, about, file))
}

/// One MCAP file with every stream as a topic `/participant/port` of a protobuf message that describes itself, the
/// poses among the fields as frame transforms on `/tf`, and the bodies of `scene` as what Foxglove calls a scene.
///
/// A pose is a pair of fields `p_XY_X` and `quat_XY`: frame Y in frame X. Log times are the stamps as nanoseconds
/// since the start of the run. `about` is the metadata record `escapement`.
pub fn mcap(
    source: &dyn Source,
    path: &Path,
    scene: Option<&Scene>,
    about: &About,
    compression: Compression,
) -> Result<(), ExportError> {
    whole_file(path, |file| mcap::write(source, scene, about, compression, file))
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
