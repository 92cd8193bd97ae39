//! The container: records, chunks and their indices, according to the MCAP specification.

use std::collections::BTreeMap;
use std::io::{self, Write};

use super::lz4;
use crate::export::file::{CountingWriter, Metadata};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Compression of an MCAP file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Compression {
    /// No compression.
    None,
    /// Each chunk is an LZ4 frame, which every reader of MCAP supports.
    #[default]
    Lz4,
}

/// Bytes of messages per chunk.
const CHUNK_BYTES: usize = 1 << 20;

/// Numbers of the record types.
mod op {
    pub(super) const HEADER: u8 = 0x01;
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const MESSAGE_INDEX: u8 = 0x07;
    pub(super) const CHUNK_INDEX: u8 = 0x08;
    pub(super) const STATISTICS: u8 = 0x0b;
    pub(super) const METADATA: u8 = 0x0c;
    pub(super) const METADATA_INDEX: u8 = 0x0d;
    pub(super) const SUMMARY_OFFSET: u8 = 0x0e;
    pub(super) const DATA_END: u8 = 0x0f;
}

/// The content of a record under construction.
#[derive(Default)]
struct Content(Vec<u8>);

impl Content {
    fn u16(mut self, x: u16) -> Content {
        self.0.extend(x.to_le_bytes());
        self
    }
    fn u32(mut self, x: u32) -> Content {
        self.0.extend(x.to_le_bytes());
        self
    }
    fn u64(mut self, x: u64) -> Content {
        self.0.extend(x.to_le_bytes());
        self
    }
    fn bytes(mut self, x: &[u8]) -> Content {
        self.0.extend((x.len() as u32).to_le_bytes());
        self.0.extend(x);
        self
    }
    fn map(self, pairs: &[(String, String)]) -> Content {
        let inner = pairs.iter().fold(Content::default(), |inner, (key, value)| {
            inner.bytes(key.as_bytes()).bytes(value.as_bytes())
        });
        self.bytes(&inner.0)
    }
    fn counts<K: Copy + Into<u64>>(self, counts: &BTreeMap<u16, K>) -> Content {
        let inner = counts.iter().fold(Content::default(), |inner, (id, count)| {
            inner.u16(*id).u64((*count).into())
        });
        self.bytes(&inner.0)
    }
    fn record(&self, op: u8) -> Vec<u8> {
        let mut out = vec![op];
        out.extend((self.0.len() as u64).to_le_bytes());
        out.extend(&self.0);
        out
    }
}

/// An MCAP file being written.
pub(super) struct Container<'a, W: Write> {
    file: CountingWriter<'a, W>,
    compression: Compression,
    metadata: Vec<Vec<u8>>,
    schemas: Vec<Vec<u8>>,
    channels: Vec<Vec<u8>>,
    chunk: Vec<u8>,
    /// Log time and offset of each message of the open chunk, by channel.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    chunk_range: Option<(u64, u64)>,
    chunk_indices: Vec<Vec<u8>>,
    counts: BTreeMap<u16, u64>,
    range: Option<(u64, u64)>,
}

fn widen(range: Option<(u64, u64)>, time: u64) -> Option<(u64, u64)> {
    Some(range.map_or((time, time), |(from, to)| (from.min(time), to.max(time))))
}

/// The number of a schema or a channel: the format gives it two bytes.
fn number(count: usize) -> io::Result<u16> {
    let many = "MCAP has room for 65535 streams; CSV and Parquet have a file for each";
    u16::try_from(count).map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, many))
}

impl<'a, W: Write> Container<'a, W> {
    pub(super) fn begin(mut file: CountingWriter<'a, W>, compression: Compression) -> io::Result<Container<'a, W>> {
        file.put(MAGIC)?;
        let header = Content::default()
            .bytes(b"")
            .bytes(concat!("escapement ", env!("CARGO_PKG_VERSION")).as_bytes());
        file.put(&header.record(op::HEADER))?;
        Ok(Container {
            file,
            compression,
            metadata: Vec::new(),
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk: Vec::new(),
            index: BTreeMap::new(),
            chunk_range: None,
            chunk_indices: Vec::new(),
            counts: BTreeMap::new(),
            range: None,
        })
    }

    /// Writes keys and values under a name.
    pub(super) fn metadata(&mut self, name: &str, about: &Metadata) -> io::Result<()> {
        let pairs: Vec<(String, String)> = about
            .iter()
            .map(|(key, value)| ((*key).to_owned(), value.clone()))
            .collect();
        let record = Content::default()
            .bytes(name.as_bytes())
            .map(&pairs)
            .record(op::METADATA);
        let index = Content::default().u64(self.file.position).u64(record.len() as u64);
        self.metadata
            .push(index.bytes(name.as_bytes()).record(op::METADATA_INDEX));
        self.file.put(&record)
    }

    /// Declares a protobuf schema; returns its number.
    pub(super) fn schema(&mut self, name: &str, file_descriptor_set: &[u8]) -> io::Result<u16> {
        let id = number(self.schemas.len() + 1)?;
        let record = Content::default()
            .u16(id)
            .bytes(name.as_bytes())
            .bytes(b"protobuf")
            .bytes(file_descriptor_set)
            .record(op::SCHEMA);
        self.file.put(&record)?;
        self.schemas.push(record);
        Ok(id)
    }

    /// Declares a channel; returns its number.
    pub(super) fn channel(&mut self, schema: u16, topic: &str, metadata: &[(String, String)]) -> io::Result<u16> {
        let id = number(self.channels.len())?;
        let record = Content::default()
            .u16(id)
            .u16(schema)
            .bytes(topic.as_bytes())
            .bytes(b"protobuf")
            .map(metadata)
            .record(op::CHANNEL);
        self.file.put(&record)?;
        self.channels.push(record);
        self.counts.insert(id, 0);
        Ok(id)
    }

    /// Writes a message; `time` is in nanoseconds.
    pub(super) fn message(&mut self, channel: u16, sequence: u32, time: u64, data: &[u8]) -> io::Result<()> {
        let entry = (time, self.chunk.len() as u64);
        self.index.entry(channel).or_default().push(entry);
        self.chunk.push(op::MESSAGE);
        self.chunk.extend((22 + data.len() as u64).to_le_bytes());
        self.chunk.extend(channel.to_le_bytes());
        self.chunk.extend(sequence.to_le_bytes());
        self.chunk.extend(time.to_le_bytes());
        self.chunk.extend(time.to_le_bytes());
        self.chunk.extend(data);
        self.chunk_range = widen(self.chunk_range, time);
        *self.counts.entry(channel).or_default() += 1;
        if self.chunk.len() >= CHUNK_BYTES {
            self.close_chunk()?;
        }
        Ok(())
    }

    fn close_chunk(&mut self) -> io::Result<()> {
        let Some((from, to)) = self.chunk_range.take() else {
            return Ok(());
        };
        let (start, size) = (self.file.position, self.chunk.len() as u64);
        let (name, packed) = match self.compression {
            Compression::None => (&b""[..], None),
            Compression::Lz4 => (&b"lz4"[..], Some(lz4::frame(&self.chunk))),
        };
        let records = packed.as_deref().unwrap_or(&self.chunk);
        let stored = records.len() as u64;
        let head = Content::default()
            .u64(from)
            .u64(to)
            .u64(size)
            .u32(crc32fast::hash(&self.chunk))
            .bytes(name)
            .u64(stored);
        self.file.put(&[op::CHUNK])?;
        self.file.put(&(head.0.len() as u64 + stored).to_le_bytes())?;
        self.file.put(&head.0)?;
        self.file.put(records)?;
        self.chunk.clear();
        let length = self.file.position - start;
        let mut offsets: BTreeMap<u16, u64> = BTreeMap::new();
        for (channel, entries) in &mut self.index {
            if entries.is_empty() {
                continue;
            }
            offsets.insert(*channel, self.file.position);
            let inner = entries
                .iter()
                .fold(Content::default(), |inner, (time, place)| inner.u64(*time).u64(*place));
            entries.clear();
            let record = Content::default()
                .u16(*channel)
                .bytes(&inner.0)
                .record(op::MESSAGE_INDEX);
            self.file.put(&record)?;
        }
        let index = Content::default()
            .u64(from)
            .u64(to)
            .u64(start)
            .u64(length)
            .counts(&offsets)
            .u64(self.file.position - start - length)
            .bytes(name)
            .u64(stored)
            .u64(size);
        self.chunk_indices.push(index.record(op::CHUNK_INDEX));
        self.range = widen(widen(self.range, from), to);
        Ok(())
    }

    /// Writes the last chunk and the summary.
    pub(super) fn end(mut self) -> io::Result<()> {
        self.close_chunk()?;
        self.file.put(&Content::default().u32(0).record(op::DATA_END))?;
        let start = self.file.position;
        let (first, last) = self.range.unwrap_or((0, 0));
        let statistics = Content::default()
            .u64(self.counts.values().sum())
            .u16(self.schemas.len() as u16)
            .u32(self.channels.len() as u32)
            .u32(0)
            .u32(self.metadata.len() as u32)
            .u32(self.chunk_indices.len() as u32)
            .u64(first)
            .u64(last)
            .counts(&self.counts)
            .record(op::STATISTICS);
        let groups = [
            (op::SCHEMA, self.schemas),
            (op::CHANNEL, self.channels),
            (op::STATISTICS, vec![statistics]),
            (op::CHUNK_INDEX, self.chunk_indices),
            (op::METADATA_INDEX, self.metadata),
        ];
        let mut crc = crc32fast::Hasher::new();
        let mut offsets = Vec::new();
        for (op, records) in groups {
            let group = self.file.position;
            for record in &records {
                crc.update(record);
                self.file.put(record)?;
            }
            if self.file.position > group {
                let length = self.file.position - group;
                let mut content = Content(vec![op]);
                content = content.u64(group).u64(length);
                offsets.push(content.record(op::SUMMARY_OFFSET));
            }
        }
        let offset_start = self.file.position;
        for record in &offsets {
            crc.update(record);
            self.file.put(record)?;
        }
        // The checksum covers the summary and the footer up to the checksum itself.
        let mut footer = Content::default()
            .u64(start)
            .u64(offset_start)
            .u32(0)
            .record(op::FOOTER);
        let covered = footer.len() - 4;
        crc.update(&footer[..covered]);
        footer[covered..].copy_from_slice(&crc.finalize().to_le_bytes());
        self.file.put(&footer)?;
        self.file.put(MAGIC)
    }
}
