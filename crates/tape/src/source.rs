//! Sources of recorded samples.

use lockstep::port::Field;

use super::hash::combine_hashes;
use super::spec::STAMP_BYTES;
use super::{Digest, ReadError, StreamSpec};

/// A source of samples: a [`Reader`](super::Reader) over files or a [`MemoryTape`](super::MemoryTape).
pub trait Source {
    /// The streams, each identified by its position in this list.
    fn streams(&self) -> &[StreamSpec];

    /// How many complete records stream number `stream` has.
    ///
    /// # Panics
    /// When there is no such stream.
    fn count(&self, stream: usize) -> u64;

    /// Fills `records`, whose length is a whole number of records, with the records from number `first` on, counted from 0.
    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError>;

    /// The number of the stream `participant.port`.
    fn stream(&self, name: &str) -> Result<usize, ReadError> {
        self.streams()
            .iter()
            .position(|spec| name.split_once('.') == Some(spec.key()))
            .ok_or_else(|| ReadError::NoStream {
                name: name.to_owned(),
                available: join_names(self.streams().iter().map(StreamSpec::name)),
            })
    }

    /// The field `participant.port.field`.
    fn field(&self, path: &str) -> Result<FieldRef, ReadError> {
        // Names of participants and ports have no dots; a field of a foreign participant may.
        let name_end = path.match_indices('.').nth(1).map_or(path.len(), |(at, _)| at);
        let stream = self.stream(&path[..name_end])?;
        let spec = &self.streams()[stream];
        let name = path.get(name_end + 1..).unwrap_or_default();
        let field = spec.descriptor.field(name).ok_or_else(|| ReadError::NoField {
            stream: spec.name(),
            field: name.to_owned(),
            available: join_names(spec.descriptor.fields.iter().map(|field| field.name.clone())),
        })?;
        Ok(FieldRef {
            stream,
            field: field.clone(),
        })
    }

    /// The digest of the whole content of this source.
    fn digest(&self) -> Result<Digest, ReadError> {
        let mut parts = Vec::with_capacity(self.streams().len());
        for (stream, spec) in self.streams().iter().enumerate() {
            parts.push((spec, self.count(stream), hash_stream(self, stream)?));
        }
        Ok(combine_hashes(parts.into_iter()))
    }

    /// Checks that a read of `bytes` bytes from record `first` on stays inside the stream; returns the size of a record.
    ///
    /// # Panics
    /// When `bytes` is not a whole number of records: a mistake of the caller, not of the tape.
    #[doc(hidden)]
    fn check_range(&self, stream: usize, first: u64, bytes: usize) -> Result<usize, ReadError> {
        let spec = self.streams().get(stream).ok_or_else(|| ReadError::NoStream {
            name: format!("number {stream}"),
            available: join_names(self.streams().iter().map(StreamSpec::name)),
        })?;
        let stride = spec.stride();
        assert!(
            bytes.is_multiple_of(stride),
            "{bytes} bytes are not whole records of {stride}"
        );
        let count = self.count(stream);
        let end = first.saturating_add((bytes / stride) as u64);
        if end > count {
            return Err(ReadError::Range {
                stream: spec.name(),
                record: count.max(first),
                count,
            });
        }
        Ok(stride)
    }
}

impl<S: Source + ?Sized> Source for &S {
    fn streams(&self) -> &[StreamSpec] {
        (**self).streams()
    }

    fn count(&self, stream: usize) -> u64 {
        (**self).count(stream)
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        (**self).read(stream, first, records)
    }
}

fn join_names(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

/// A field of a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldRef {
    /// The number of the stream.
    pub stream: usize,
    /// The field's description.
    pub field: Field,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record<'a> {
    /// The index of the sample in its run.
    pub index: u64,
    /// The stamp, s.
    pub stamp_s: f64,
    /// The payload as it was published.
    pub payload: &'a [u8],
}

/// The records of one stream in order, read in chunks of some hundred kilobytes.
pub struct Records<'a, S: Source + ?Sized> {
    source: &'a S,
    stream: usize,
    stride: usize,
    first_index: u64,
    /// Records `start..end` are in `buffer`.
    start: u64,
    end: u64,
    next: u64,
    count: u64,
    buffer: Vec<u8>,
}

/// The number of bytes that [`Records`] reads at once.
const CHUNK_BYTES: usize = 1 << 18;

impl<'a, S: Source + ?Sized> Records<'a, S> {
    /// All current records of stream number `stream`.
    ///
    /// # Panics
    /// When there is no such stream.
    pub fn new(source: &'a S, stream: usize) -> Records<'a, S> {
        let spec = &source.streams()[stream];
        let stride = spec.stride();
        Records {
            stride,
            first_index: spec.first_index,
            start: 0,
            end: 0,
            next: 0,
            count: source.count(stream),
            buffer: vec![0; (CHUNK_BYTES / stride).max(1) * stride],
            source,
            stream,
        }
    }

    /// The next record; `None` after the last one.
    #[allow(
        clippy::should_implement_trait,
        reason = "the record borrows from the buffer; no iterator can give it"
    )]
    pub fn next(&mut self) -> Result<Option<Record<'_>>, ReadError> {
        if self.next == self.count {
            return Ok(None);
        }
        if self.next == self.end {
            let records = ((self.buffer.len() / self.stride) as u64).min(self.count - self.next);
            let bytes = &mut self.buffer[..records as usize * self.stride];
            self.source.read(self.stream, self.next, bytes)?;
            (self.start, self.end) = (self.next, self.next + records);
        }
        let at = (self.next - self.start) as usize * self.stride;
        let record = split_record(&self.buffer[at..at + self.stride], self.first_index + self.next);
        self.next += 1;
        Ok(Some(record))
    }

    /// The number of remaining records.
    pub fn remaining(&self) -> u64 {
        self.count - self.next
    }
}

/// Splits a record into its parts.
pub fn split_record(bytes: &[u8], index: u64) -> Record<'_> {
    let (stamp, payload) = bytes.split_at(STAMP_BYTES);
    let mut raw = [0; STAMP_BYTES];
    raw.copy_from_slice(stamp);
    Record {
        index,
        stamp_s: f64::from_le_bytes(raw),
        payload,
    }
}

/// The hash of one stream's complete records.
pub(crate) fn hash_stream(source: &(impl Source + ?Sized), stream: usize) -> Result<Digest, ReadError> {
    let stride = source.streams()[stream].stride();
    let at_once = (1 << 20) / stride + 1;
    let mut buffer = vec![0; at_once * stride];
    let mut hasher = blake3::Hasher::new();
    let (mut next, count) = (0, source.count(stream));
    while next < count {
        let records = (count - next).min(at_once as u64);
        let bytes = &mut buffer[..records as usize * stride];
        source.read(stream, next, bytes)?;
        hasher.update(bytes);
        next += records;
    }
    Ok(hasher.finalize().into())
}
