//! Comma-separated values (RFC 4180).

use std::io::Write;
use std::path::{Path, PathBuf};

use super::columns::{Column, Number, TIME, columns, distinct, number};
use super::error::ExportError;
use super::file::{PartialFile, WriteError};
use super::npy;
use tape::{Records, Source};

/// Writes the table of a stream, and the array of each field that is too wide for a table. Returns the files.
pub(super) fn write(source: &dyn Source, stream: usize, dir: &Path) -> Result<Vec<PathBuf>, ExportError> {
    let spec = &source.streams()[stream];
    let (wide, columns): (Vec<_>, Vec<_>) = columns(spec).into_iter().partition(Column::is_wide);
    let mut records = Records::new(source, stream);
    let mut table = PartialFile::create(dir.join(format!("{}.csv", spec.name())))?;
    let mut arrays = Vec::with_capacity(wide.len());
    for (column, name) in wide.iter().zip(array_names(&wide)) {
        let mut array = PartialFile::create(dir.join(format!("{}.{name}.npy", spec.name())))?;
        array.put(&npy::head(column.field, records.remaining()))?;
        arrays.push(array);
    }
    let mut line = TIME.to_owned();
    for column in &columns {
        line.push(',');
        line.push_str(&quoted(&column.name));
    }
    line.push('\n');
    table.put(line.as_bytes())?;
    while let Some(record) = records.next()? {
        row(&mut table, &columns, record.stamp_s, record.payload)?;
        for (column, array) in wide.iter().zip(&mut arrays) {
            array.put(column.cell(record.payload))?;
        }
    }
    std::iter::once(table).chain(arrays).map(PartialFile::finish).collect()
}

fn row(table: &mut PartialFile, columns: &[Column<'_>], stamp_s: f64, payload: &[u8]) -> Result<(), ExportError> {
    table.write(|out| {
        // `{:?}` of a float is the shortest text that parses to the same number, with an exponent where that is shorter.
        write!(out, "{stamp_s:?}")?;
        for column in columns {
            if let Some(name) = column.name_in(payload) {
                write!(out, ",{}", quoted(name))?;
                continue;
            }
            if let Some(content) = column.content_in(payload) {
                write!(out, ",{}", quoted(&content))?;
                continue;
            }
            match number(column.field.element, payload, column.start) {
                Number::F64(x) => write!(out, ",{x:?}")?,
                Number::F32(x) => write!(out, ",{x:?}")?,
                Number::I64(x) => write!(out, ",{x}")?,
                Number::U64(x) => write!(out, ",{x}")?,
            }
        }
        out.write_all(b"\n").map_err(WriteError::Io)
    })
}

/// The fields' names as unique parts of file names, also on case-insensitive file systems.
fn array_names(wide: &[Column<'_>]) -> Vec<String> {
    let plain = |column: &Column<'_>| -> String {
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        column.field.name.chars().map(safe).take(96).collect()
    };
    let folded = wide.iter().map(|column| plain(column).to_ascii_lowercase()).collect();
    let numbered = |at: usize, n: usize| format!("{}_{n}", plain(&wide[at]).to_ascii_lowercase());
    let told_apart = distinct(folded, numbered).into_iter();
    // The suffix that makes a name unique is appended to the name in its original case.
    let names = told_apart.zip(wide).map(|(name, column)| {
        let plain = plain(column);
        format!("{plain}{}", &name[plain.len()..])
    });
    names.collect()
}

/// Quotes a text that may contain a comma, a quote or a newline, such as the name of an external participant's field.
pub(super) fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
