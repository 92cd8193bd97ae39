//! Parquet, as far as a tape needs it: required columns of numbers, of bytes of a fixed number, and of lists; plain encoding,
//! no compression.
//!
//! Layout of a file: `PAR1`; per row group one data page per column; the footer (schema, where the pages are, metadata) in
//! Thrift's compact protocol; its length; `PAR1`. See the Apache Parquet format specification.

mod arrow;
mod sheet;
mod thrift;

use std::fs::File;
use std::io::BufWriter;

use lockstep::port::Element;
use serde_json::json;

use super::columns::{Column, TIME, columns};
use super::{About, Counted, WriteError, varint};
use crate::page::base64;
use tape::{Records, Source, StreamSpec};
use thrift::Struct;

pub(super) use sheet::write as write_sheet;

/// Bytes of values that a row group collects before it is written.
const GROUP_BYTES: usize = 16 << 20;

/// A column chunk in the file.
struct Chunk {
    offset: u64,
    /// Header and values, bytes.
    size: u64,
}

/// A column as the footer describes it.
struct Leaf<'a> {
    name: &'a str,
    /// Parquet's number of the physical type.
    physical: i32,
    /// Parquet's number of the converted type, where the physical one says too little.
    converted: Option<i32>,
    cell: Cell,
}

/// What a cell of a column is.
#[derive(Clone, Copy, PartialEq)]
enum Cell {
    /// A value.
    One,
    /// A value that may be missing.
    Optional,
    /// So many bytes.
    Bytes(usize),
    /// A list of so many values.
    List(usize),
}

impl Leaf<'_> {
    /// A column of a stream, or the stamp.
    fn of(name: &str, element: Element, elements: usize) -> Leaf<'_> {
        const FIXED_LENGTH_BYTES: i32 = 7;
        let (physical, converted) = types(element);
        let (physical, converted, cell) = match (element, elements) {
            (_, 1) => (physical, converted, Cell::One),
            // As integers, bytes would take four times the room.
            (Element::U8, _) => (FIXED_LENGTH_BYTES, None, Cell::Bytes(elements)),
            _ => (physical, converted, Cell::List(elements)),
        };
        Leaf {
            name,
            physical,
            converted,
            cell,
        }
    }

    /// How many values a row has.
    fn values(&self) -> u64 {
        match self.cell {
            Cell::List(elements) => elements as u64,
            _ => 1,
        }
    }

    /// Where the values are, from the root of the schema.
    fn path(&self) -> Vec<&str> {
        match self.cell {
            Cell::List(_) => vec![self.name, "list", "element"],
            _ => vec![self.name],
        }
    }

    /// The entries of the schema.
    fn schema(&self) -> Vec<Struct> {
        const REQUIRED: i32 = 0;
        const OPTIONAL: i32 = 1;
        const REPEATED: i32 = 2;
        const LIST: i32 = 3;
        let mut entries = Vec::new();
        let name = if let Cell::List(_) = self.cell {
            let (mut outer, mut inner) = (Struct::default(), Struct::default());
            outer.i32(3, REQUIRED).text(4, self.name).i32(5, 1).i32(6, LIST);
            inner.i32(3, REPEATED).text(4, "list").i32(5, 1);
            entries.extend([outer, inner]);
            "element"
        } else {
            self.name
        };
        let mut described = Struct::default();
        described.i32(1, self.physical);
        if let Cell::Bytes(length) = self.cell {
            described.i32(2, length as i32);
        }
        let optional = self.cell == Cell::Optional;
        described
            .i32(3, if optional { OPTIONAL } else { REQUIRED })
            .text(4, name);
        if let Some(converted) = self.converted {
            described.i32(6, converted);
        }
        entries.push(described);
        entries
    }
}

/// Parquet's number of a physical type, and of the converted type where the physical one says too little.
fn types(element: Element) -> (i32, Option<i32>) {
    match element {
        Element::I32 => (1, None),
        Element::U32 => (1, Some(13)),
        Element::U8 => (1, Some(11)),
        Element::I64 => (2, None),
        Element::U64 => (2, Some(14)),
        Element::F32 => (4, None),
        Element::F64 => (5, None),
    }
}

/// Bytes of a cell in a page: a byte that stands alone becomes a 32-bit integer.
fn width(column: &Column<'_>) -> usize {
    (column.elements * column.field.element.size()).max(4)
}

pub(super) fn write(
    source: &dyn Source,
    stream: usize,
    about: &About,
    out: &mut BufWriter<File>,
) -> Result<(), WriteError> {
    let spec = &source.streams()[stream];
    let columns = columns(spec);
    let leaves: Vec<Leaf<'_>> = std::iter::once(Leaf::of(TIME, Element::F64, 1))
        .chain(columns.iter().map(|c| Leaf::of(&c.name, c.field.element, c.elements)))
        .collect();
    let mut file = Counted::new(out);
    file.put(b"PAR1")?;
    let row_bytes = 8 + columns.iter().map(width).sum::<usize>();
    let rows_at_once = (GROUP_BYTES / row_bytes).max(1) as u64;
    let mut records = Records::new(source, stream);
    // Values by column, the stamp first; the buffers are used again for every row group.
    let mut values: Vec<Vec<u8>> = vec![Vec::new(); leaves.len()];
    let mut groups: Vec<(u64, Vec<Chunk>)> = Vec::new();
    while records.remaining() > 0 {
        let rows = records.remaining().min(rows_at_once);
        for _ in 0..rows {
            let Some(record) = records.next()? else { break };
            values[0].extend_from_slice(&record.stamp_s.to_le_bytes());
            for (column, values) in columns.iter().zip(&mut values[1..]) {
                let bytes = column.cell(record.payload);
                values.extend_from_slice(bytes);
                values.extend(std::iter::repeat_n(0, width(column) - bytes.len()));
            }
        }
        let mut chunks = Vec::with_capacity(values.len());
        for (values, leaf) in values.iter_mut().zip(&leaves) {
            let offset = file.position;
            let levels = levels(leaf.cell, rows);
            file.put(&page_header(levels.len() + values.len(), rows * leaf.values()))?;
            file.put(&levels)?;
            file.put(values)?;
            values.clear();
            chunks.push(Chunk {
                offset,
                size: file.position - offset,
            });
        }
        groups.push((rows, chunks));
    }
    let footer = footer(spec, about, &columns, &leaves, &groups);
    file.put(&footer)?;
    file.put(&(footer.len() as u32).to_le_bytes())?;
    file.put(b"PAR1")?;
    Ok(())
}

/// What stands before the values of a page: for lists where each one begins (level 0), and that every element is there.
fn levels(cell: Cell, rows: u64) -> Vec<u8> {
    let Cell::List(elements) = cell else {
        return Vec::new();
    };
    let run = |out: &mut Vec<u8>, count: u64, level: u8| {
        varint(out, count << 1);
        out.push(level);
    };
    let (mut begins, mut there) = (Vec::new(), Vec::new());
    for _ in 0..rows {
        run(&mut begins, 1, 0);
        run(&mut begins, elements as u64 - 1, 1);
    }
    run(&mut there, rows * elements as u64, 1);
    let mut levels = Vec::new();
    for part in [begins, there] {
        levels.extend((part.len() as u32).to_le_bytes());
        levels.extend(part);
    }
    levels
}

fn page_header(bytes: usize, values: u64) -> Vec<u8> {
    const PLAIN: i32 = 0;
    const RUN_LENGTH: i32 = 3;
    let mut page = Struct::default();
    page.i32(1, 0).i32(2, bytes as i32).i32(3, bytes as i32);
    let mut data = Struct::default();
    data.i32(1, values as i32)
        .i32(2, PLAIN)
        .i32(3, RUN_LENGTH)
        .i32(4, RUN_LENGTH);
    page.structure(5, data);
    page.end()
}

fn footer(
    spec: &StreamSpec,
    about: &About,
    columns: &[Column<'_>],
    leaves: &[Leaf<'_>],
    groups: &[(u64, Vec<Chunk>)],
) -> Vec<u8> {
    let stream = json!({
        "participant": spec.participant,
        "port": spec.port,
        "offset": spec.offset,
        "period": spec.period,
        "first_index": spec.first_index,
        "descriptor": spec.descriptor,
    });
    let known = about
        .iter()
        .map(|(key, value)| (format!("escapement.{key}"), value.clone()));
    let known: Vec<(String, String)> = known.collect();
    let mut metadata = vec![
        ("escapement.stream", stream.to_string()),
        ("ARROW:schema", base64(arrow::schema(columns).into_iter())),
    ];
    metadata.extend(known.iter().map(|(key, value)| (key.as_str(), value.clone())));
    describe("sample", leaves, groups, &metadata)
}

/// The footer: schema, where the pages are, metadata.
fn describe(name: &str, leaves: &[Leaf<'_>], groups: &[(u64, Vec<Chunk>)], metadata: &[(&str, String)]) -> Vec<u8> {
    let mut schema = vec![{
        let mut root = Struct::default();
        root.text(4, name).i32(5, leaves.len() as i32);
        root
    }];
    schema.extend(leaves.iter().flat_map(Leaf::schema));
    let row_groups = groups.iter().map(|(rows, chunks)| {
        let placed = chunks.iter().zip(leaves).map(|(chunk, leaf)| {
            let mut meta = Struct::default();
            meta.i32(1, leaf.physical)
                .i32_list(2, &[0, 3])
                .text_list(3, &leaf.path())
                .i32(4, 0)
                .i64(5, (*rows * leaf.values()) as i64)
                .i64(6, chunk.size as i64)
                .i64(7, chunk.size as i64)
                .i64(9, chunk.offset as i64);
            let mut placed = Struct::default();
            placed.i64(2, chunk.offset as i64).structure(3, meta);
            placed
        });
        let mut group = Struct::default();
        group.structures(1, placed.collect());
        group
            .i64(2, chunks.iter().map(|c| c.size as i64).sum())
            .i64(3, *rows as i64);
        group
    });
    let metadata = metadata.iter().map(|(key, value)| {
        let mut entry = Struct::default();
        entry.text(1, key).text(2, value);
        entry
    });
    let mut file = Struct::default();
    file.i32(1, 2);
    file.structures(2, schema);
    file.i64(3, groups.iter().map(|(rows, _)| *rows as i64).sum());
    file.structures(4, row_groups.collect());
    file.structures(5, metadata.collect());
    file.text(6, concat!("escapement ", env!("CARGO_PKG_VERSION")));
    file.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_lists_are_two_runs_a_row() {
        assert!(levels(Cell::One, 7).is_empty());
        // Two lists of 300: a begin and 299 others each; 600 elements that are there.
        let begins = [2, 0, 0xd6, 0x04, 1, 2, 0, 0xd6, 0x04, 1];
        let there = [0xb0, 0x09, 1];
        let expected = [&[10, 0, 0, 0][..], &begins, &[3, 0, 0, 0], &there].concat();
        assert_eq!(levels(Cell::List(300), 2), expected);
    }
}
