//! Comma-separated values (RFC 4180).

use std::fs::File;
use std::io::{BufWriter, Write};

use super::WriteError;
use super::columns::{Number, TIME, columns, number};
use tape::{Records, Source};

pub(super) fn write(source: &dyn Source, stream: usize, out: &mut BufWriter<File>) -> Result<(), WriteError> {
    let columns = columns(&source.streams()[stream]);
    write!(out, "{TIME}")?;
    for column in &columns {
        write!(out, ",{}", quoted(&column.name))?;
    }
    out.write_all(b"\n")?;
    let mut records = Records::new(source, stream);
    while let Some(record) = records.next()? {
        // `{:?}` of a float is the shortest text that reads back to it, with an exponent where that is shorter.
        write!(out, "{:?}", record.stamp_s)?;
        for column in &columns {
            match number(column.field.element, record.payload, column.start) {
                Number::F64(x) => write!(out, ",{x:?}")?,
                Number::F32(x) => write!(out, ",{x:?}")?,
                Number::I64(x) => write!(out, ",{x}")?,
                Number::U64(x) => write!(out, ",{x}")?,
            }
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// A text that may hold a comma, a quote or a line's end, such as the name of a foreign participant's field.
pub(super) fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
