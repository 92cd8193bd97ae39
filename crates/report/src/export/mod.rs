//! Tapes as files that other tools open: CSV, Parquet, MAT, MCAP.
//!
//! Every export reads the tape once, in order, and uses a few megabytes of memory whatever its length. A file gets its
//! final name only when it is complete.
//!
//! The writers of Parquet, MAT and MCAP are implemented here, in a few hundred lines each. A tape needs a small subset of
//! these formats (columns of numbers without gaps; chunks of messages), and the full libraries would more than double the
//! code that this crate compiles. Tests open the files with the readers that users have.

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
pub use file::Metadata;
use file::write_complete_file;
pub use mcap::Compression;
pub use sheet::{Cells, Sheet, SheetColumn};

/// Writes one CSV file per stream into the folder `dir`: `<participant>.<port>.csv`. The first line has the columns' names
/// with their units; numbers are the shortest text that parses to the same number. Returns the files.
///
/// A field of more than 256 elements, such as a picture, is not part of the table: it is a NumPy array in a separate file,
/// `<participant>.<port>.<field>.npy`, whose first dimension is the number of samples, followed by the field's own shape.
pub fn csv(source: &dyn Source, dir: &Path) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, csv::write)
}

/// Writes one Parquet file per stream into the folder `dir`: `<participant>.<port>.parquet`, a column of the field's own
/// type per element. A field of more than 256 elements is one column: fixed-length bytes for `u8`, a fixed-length list for
/// the other types. Unit, frame, field and shape of each column are in the column's metadata as Arrow readers show it, and
/// `about` in that of the file, with the prefix `escapement.` on each key. Returns the files.
pub fn parquet(source: &dyn Source, dir: &Path, about: &Metadata) -> Result<Vec<PathBuf>, ExportError> {
    per_stream(source, dir, |source, stream, dir| {
        let path = dir.join(format!("{}.parquet", source.streams()[stream].name()));
        write_complete_file(&path, |file| parquet::write(source, stream, about, file))?;
        Ok(vec![path])
    })
}

/// Writes one MAT file of version 5 with a struct per stream, `participant_port`: the stamps as `t`, an array per field of
/// the field's own type, with the samples along the first dimension (along the last one for fields of more than 256
/// elements), `info` with name, unit and frame of each field, and the stream's name as `stream`. Names that MATLAB does not
/// allow are changed. `about` is the struct `escapement`.
pub fn mat(source: &dyn Source, path: &Path, about: &Metadata) -> Result<(), ExportError> {
    if let Some((stream, bytes)) = mat::too_large(source) {
        return Err(ExportError::TooLarge { stream, bytes });
    }
    write_complete_file(path, |file| mat::write(source, about, file))
}

/// Writes one MCAP file with every stream as a topic `/participant/port` of a self-describing protobuf message, the poses
/// among the fields as frame transforms on `/tf`, and the bodies of `scene` as Foxglove scene entities.
///
/// A pose is a pair of fields `p_XY_X` and `quat_XY`: frame Y in frame X. Log times are the stamps as nanoseconds
/// since the start of the run. `about` is the metadata record `escapement`.
pub fn mcap(
    source: &dyn Source,
    path: &Path,
    scene: Option<&Scene>,
    about: &Metadata,
    compression: Compression,
) -> Result<(), ExportError> {
    write_complete_file(path, |file| mcap::write(source, scene, about, compression, file))
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
