//! Parquet, as far as a tape needs it: required columns of numbers, plain encoding, no compression.
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
use super::{Counted, WriteError};
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
    /// Whether values may be missing.
    optional: bool,
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

/// Bytes of a value in a page: bytes become 32-bit integers.
fn width(element: Element) -> usize {
    element.size().max(4)
}

pub(super) fn write(source: &dyn Source, stream: usize, out: &mut BufWriter<File>) -> Result<(), WriteError> {
    let spec = &source.streams()[stream];
    let columns = columns(spec);
    let mut file = Counted::new(out);
    file.put(b"PAR1")?;
    let row_bytes = 8 + columns.iter().map(|c| width(c.field.element)).sum::<usize>();
    let rows_at_once = (GROUP_BYTES / row_bytes).max(1) as u64;
    let mut records = Records::new(source, stream);
    // Values by column, the stamp first; the buffers are used again for every row group.
    let mut values: Vec<Vec<u8>> = vec![Vec::new(); columns.len() + 1];
    let mut groups: Vec<(u64, Vec<Chunk>)> = Vec::new();
    while records.remaining() > 0 {
        let rows = records.remaining().min(rows_at_once);
        for _ in 0..rows {
            let Some(record) = records.next()? else { break };
            values[0].extend_from_slice(&record.stamp_s.to_le_bytes());
            for (column, values) in columns.iter().zip(&mut values[1..]) {
                let bytes = &record.payload[column.start..column.start + column.field.element.size()];
                values.extend_from_slice(bytes);
                values.extend(std::iter::repeat_n(0, width(column.field.element) - bytes.len()));
            }
        }
        let mut chunks = Vec::with_capacity(values.len());
        for values in &mut values {
            let offset = file.position;
            file.put(&page_header(values.len(), rows))?;
            file.put(values)?;
            values.clear();
            chunks.push(Chunk {
                offset,
                size: file.position - offset,
            });
        }
        groups.push((rows, chunks));
    }
    let footer = footer(spec, &columns, &groups);
    file.put(&footer)?;
    file.put(&(footer.len() as u32).to_le_bytes())?;
    file.put(b"PAR1")?;
    Ok(())
}

fn page_header(bytes: usize, rows: u64) -> Vec<u8> {
    const PLAIN: i32 = 0;
    const RUN_LENGTH: i32 = 3;
    let mut page = Struct::default();
    page.i32(1, 0).i32(2, bytes as i32).i32(3, bytes as i32);
    let mut data = Struct::default();
    data.i32(1, rows as i32)
        .i32(2, PLAIN)
        .i32(3, RUN_LENGTH)
        .i32(4, RUN_LENGTH);
    page.structure(5, data);
    page.end()
}

fn footer(spec: &StreamSpec, columns: &[Column<'_>], groups: &[(u64, Vec<Chunk>)]) -> Vec<u8> {
    // The stamp is a column like the others.
    let leaves = [(TIME, Element::F64)]
        .into_iter()
        .chain(columns.iter().map(|column| (&*column.name, column.field.element)));
    let leaves: Vec<Leaf<'_>> = leaves
        .map(|(name, element)| {
            let (physical, converted) = types(element);
            Leaf {
                name,
                physical,
                converted,
                optional: false,
            }
        })
        .collect();
    let about = json!({
        "participant": spec.participant,
        "port": spec.port,
        "offset": spec.offset,
        "period": spec.period,
        "first_index": spec.first_index,
        "descriptor": spec.descriptor,
    });
    let metadata = [
        ("escapement.stream", about.to_string()),
        ("ARROW:schema", base64(arrow::schema(columns).into_iter())),
    ];
    describe("sample", &leaves, groups, &metadata)
}

/// The footer: schema, where the pages are, metadata.
fn describe(name: &str, leaves: &[Leaf<'_>], groups: &[(u64, Vec<Chunk>)], metadata: &[(&str, String)]) -> Vec<u8> {
    let mut schema = vec![{
        let mut root = Struct::default();
        root.text(4, name).i32(5, leaves.len() as i32);
        root
    }];
    for leaf in leaves {
        let mut described = Struct::default();
        described
            .i32(1, leaf.physical)
            .i32(3, i32::from(leaf.optional))
            .text(4, leaf.name);
        if let Some(converted) = leaf.converted {
            described.i32(6, converted);
        }
        schema.push(described);
    }
    let row_groups = groups.iter().map(|(rows, chunks)| {
        let placed = chunks.iter().zip(leaves).map(|(chunk, leaf)| {
            let mut meta = Struct::default();
            meta.i32(1, leaf.physical)
                .i32_list(2, &[0, 3])
                .text_list(3, &[leaf.name])
                .i32(4, 0)
                .i64(5, *rows as i64)
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
