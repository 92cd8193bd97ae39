//! Parquet, the subset that a tape needs: required columns of numbers, of fixed-length bytes, and of lists; plain encoding,
//! no compression.
//!
//! Layout of a file: `PAR1`; per row group one data page per column; the footer (schema, page offsets, metadata) in
//! Thrift's compact protocol; its length; `PAR1`. See the Apache Parquet format specification.

mod arrow;
mod footer;
mod page;
mod sheet;
mod thrift;

use std::fs::File;
use std::io::BufWriter;

use lockstep::port::{Content, Element};
use serde_json::json;

use super::columns::{Column, TIME, columns, descriptor};
use super::file::{CountingWriter, Metadata, WriteError};
use crate::page::base64;
use footer::{BOOLEAN, Chunk, Leaf, describe};
use page::{levels, page_header};
use tape::{Records, Source, StreamSpec};

pub(super) use sheet::write as write_sheet;

/// Bytes of values per row group.
const GROUP_BYTES: usize = 16 << 20;

/// Approximate size of a cell in a page, bytes.
fn width(column: &Column<'_>) -> usize {
    let longest = column.field.values.iter().map(|named| named.name.len()).max();
    column.elements * column.field.element.size().max(4) + longest.unwrap_or(0)
}

/// Appends a cell to its column: numbers of one or two bytes become 32-bit integers, enumerations become texts. Texts and
/// bytes are preceded by their length.
fn put_cell(column: &Column<'_>, payload: &[u8], values: &mut Vec<u8>) {
    let (bytes, element) = (column.cell(payload), column.field.element);
    match element {
        Element::Text(_) | Element::Bytes(_) => {
            for bytes in bytes.chunks_exact(element.size()) {
                let content = element.content(bytes).ok();
                let content = content.as_ref().map_or(&[][..], Content::as_bytes);
                values.extend((content.len() as u32).to_le_bytes());
                values.extend(content);
            }
        }
        _ if element.size() >= 4 || (column.is_wide() && element.size() == 1) => values.extend_from_slice(bytes),
        Element::Bool => values.push(bytes[0]),
        Element::Enum => {
            let name = column.name_in(payload).unwrap_or_default();
            values.extend((name.len() as u32).to_le_bytes());
            values.extend(name.as_bytes());
        }
        _ => {
            for bytes in bytes.chunks_exact(element.size()) {
                values.extend((element.to_integer(bytes) as i32).to_le_bytes());
            }
        }
    }
}

/// Truth values take one bit each, least significant bit first.
fn pack_bits(truths: &mut Vec<u8>) {
    let bits = truths.chunks(8).map(|eight| {
        let each = eight.iter().enumerate();
        each.fold(0, |bits, (at, truth)| bits | (truth & 1) << at)
    });
    *truths = bits.collect();
}

pub(super) fn write(
    source: &dyn Source,
    stream: usize,
    about: &Metadata,
    out: &mut BufWriter<File>,
) -> Result<(), WriteError> {
    let spec = &source.streams()[stream];
    let columns = columns(spec);
    let leaves: Vec<Leaf<'_>> = std::iter::once(Leaf::of(TIME, Element::F64, 1))
        .chain(columns.iter().map(|c| Leaf::of(&c.name, c.field.element, c.elements)))
        .collect();
    let mut file = CountingWriter::new(out);
    file.put(b"PAR1")?;
    let row_bytes = 8 + columns.iter().map(width).sum::<usize>();
    let rows_at_once = (GROUP_BYTES / row_bytes).max(1) as u64;
    let mut records = Records::new(source, stream);
    // Values by column, the stamp first; the buffers are reused for every row group.
    let mut values: Vec<Vec<u8>> = vec![Vec::new(); leaves.len()];
    let mut groups: Vec<(u64, Vec<Chunk>)> = Vec::new();
    while records.remaining() > 0 {
        let rows = records.remaining().min(rows_at_once);
        for _ in 0..rows {
            let Some(record) = records.next()? else { break };
            values[0].extend_from_slice(&record.stamp_s.to_le_bytes());
            for (column, values) in columns.iter().zip(&mut values[1..]) {
                put_cell(column, record.payload, values);
            }
        }
        let mut chunks = Vec::with_capacity(values.len());
        for (values, leaf) in values.iter_mut().zip(&leaves) {
            let offset = file.position;
            if leaf.physical == BOOLEAN {
                pack_bits(values);
            }
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

fn footer(
    spec: &StreamSpec,
    about: &Metadata,
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
        "descriptor": descriptor(spec),
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
