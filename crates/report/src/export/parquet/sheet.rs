//! A small table as Parquet: one row group, optional columns.

use std::fs::File;
use std::io::{self, BufWriter};

use serde_json::{Map, Value};

use super::footer::{Cell, Chunk, Leaf, describe};
use super::page::page_header;
use crate::export::file::CountingWriter;
use crate::export::sheet::{Cells, Sheet};
use crate::export::varint::varint;

/// Parquet's number of a physical type and of a converted one.
fn types(cells: &Cells) -> (i32, Option<i32>) {
    const INT64: i32 = 2;
    const DOUBLE: i32 = 5;
    const BYTE_ARRAY: i32 = 6;
    const UTF8: i32 = 0;
    match cells {
        Cells::Whole(_) => (INT64, None),
        Cells::Number(_) => (DOUBLE, None),
        Cells::Text(_) => (BYTE_ARRAY, Some(UTF8)),
    }
}

pub(crate) fn write(sheet: &Sheet, out: &mut BufWriter<File>) -> io::Result<()> {
    let rows = sheet.rows();
    let mut file = CountingWriter::new(out);
    file.put(b"PAR1")?;
    let names = sheet.headings();
    let (mut leaves, mut chunks, mut units) = (Vec::new(), Vec::new(), Map::new());
    for (column, name) in sheet.columns.iter().zip(&names) {
        let page = page(&column.cells);
        let offset = file.position;
        file.put(&page_header(page.len(), rows as u64))?;
        file.put(&page)?;
        chunks.push(Chunk {
            offset,
            size: file.position - offset,
        });
        let (physical, converted) = types(&column.cells);
        leaves.push(Leaf {
            name,
            physical,
            converted,
            cell: Cell::Optional,
        });
        if !column.unit.is_empty() {
            units.insert(name.clone(), Value::String(column.unit.clone()));
        }
    }
    let metadata: Vec<(&str, String)> = [("escapement.units", Value::Object(units).to_string())]
        .into_iter()
        .chain(sheet.about.iter().map(|(key, value)| (*key, value.clone())))
        .collect();
    let footer = describe("row", &leaves, &[(rows as u64, chunks)], &metadata);
    file.put(&footer)?;
    file.put(&(footer.len() as u32).to_le_bytes())?;
    file.put(b"PAR1")
}

/// Writes which values are present, then those values.
fn page(cells: &Cells) -> Vec<u8> {
    let mut values = Vec::new();
    let there: Vec<bool> = match cells {
        Cells::Whole(all) => all
            .iter()
            .map(|value| {
                values.extend(value.to_le_bytes());
                true
            })
            .collect(),
        Cells::Number(all) => all
            .iter()
            .map(|value| {
                value.iter().for_each(|value| values.extend(value.to_le_bytes()));
                value.is_some()
            })
            .collect(),
        Cells::Text(all) => all
            .iter()
            .map(|value| {
                if let Some(text) = value {
                    values.extend((text.len() as u32).to_le_bytes());
                    values.extend(text.as_bytes());
                }
                value.is_some()
            })
            .collect(),
    };
    // Definition levels of one bit each, as one bit-packed run: its header counts groups of eight.
    let mut levels = Vec::new();
    varint(&mut levels, (there.len().div_ceil(8) as u64) << 1 | 1);
    for group in there.chunks(8) {
        levels.push(
            group
                .iter()
                .enumerate()
                .fold(0, |byte, (bit, there)| byte | u8::from(*there) << bit),
        );
    }
    let mut page = (levels.len() as u32).to_le_bytes().to_vec();
    page.extend(levels);
    page.extend(values);
    page
}
