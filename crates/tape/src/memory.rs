//! Tapes without files, for campaigns and tests.

use super::hash::combine_hashes;
use super::sequence::SequenceChecker;
use super::spec::validate_all;
use super::{AppendError, Digest, ReadError, Sink, Source, SpecError, StreamSpec};

fn checkers(streams: Vec<StreamSpec>) -> Result<Vec<SequenceChecker>, SpecError> {
    validate_all(&streams)?;
    streams.into_iter().map(SequenceChecker::new).collect()
}

/// A tape in memory. It grows with its samples: the only sink that allocates. The default one has no streams.
#[derive(Debug, Default)]
pub struct MemoryTape {
    streams: Vec<StreamSpec>,
    states: Vec<(SequenceChecker, Vec<u8>)>,
}

impl MemoryTape {
    /// An empty tape of these streams.
    pub fn new(streams: Vec<StreamSpec>) -> Result<MemoryTape, SpecError> {
        let states = checkers(streams.clone())?
            .into_iter()
            .map(|checker| (checker, Vec::new()));
        Ok(MemoryTape {
            states: states.collect(),
            streams,
        })
    }

    /// Keeps the first `counts` samples of each stream, in the order of their numbers, and discards the rest.
    pub fn truncate(&mut self, counts: &[u64]) {
        for ((checker, bytes), &count) in self.states.iter_mut().zip(counts) {
            checker.truncate(count);
            bytes.truncate(checker.count() as usize * checker.spec().stride());
        }
    }
}

impl Sink for MemoryTape {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.states.len();
        let (checker, bytes) = self
            .states
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        checker.check(index, stamp_s, payload)?;
        bytes.extend_from_slice(&stamp_s.to_le_bytes());
        bytes.extend_from_slice(payload);
        checker.advance();
        Ok(())
    }
}

impl Source for MemoryTape {
    fn streams(&self) -> &[StreamSpec] {
        &self.streams
    }

    fn count(&self, stream: usize) -> u64 {
        self.states[stream].0.count()
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        let stride = self.check_range(stream, first, records.len())?;
        let start = first as usize * stride;
        records.copy_from_slice(&self.states[stream].1[start..start + records.len()]);
        Ok(())
    }
}

/// Keeps only the hash: shows whether a run has the same tape as another, without a copy of the tape in memory or on disk.
#[derive(Debug)]
pub struct DigestSink {
    states: Vec<StreamHasher>,
}

#[derive(Debug)]
struct StreamHasher {
    checker: SequenceChecker,
    hasher: blake3::Hasher,
    /// Records are hashed in batches, which is several times faster than one by one.
    pending: Vec<u8>,
}

/// The size of a batch, bytes.
const PENDING_BYTES: usize = 1 << 14;

impl DigestSink {
    /// A sink for these streams.
    pub fn new(streams: Vec<StreamSpec>) -> Result<DigestSink, SpecError> {
        let states = checkers(streams)?.into_iter().map(|checker| StreamHasher {
            pending: Vec::with_capacity(PENDING_BYTES + checker.spec().stride()),
            hasher: blake3::Hasher::new(),
            checker,
        });
        Ok(DigestSink {
            states: states.collect(),
        })
    }

    /// The digest that a tape of all samples so far would have.
    pub fn digest(&self) -> Digest {
        combine_hashes(self.states.iter().map(|state| {
            let mut hasher = state.hasher.clone();
            hasher.update(&state.pending);
            (state.checker.spec(), state.checker.count(), hasher.finalize().into())
        }))
    }
}

impl Sink for DigestSink {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.states.len();
        let state = self
            .states
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        state.checker.check(index, stamp_s, payload)?;
        state.pending.extend_from_slice(&stamp_s.to_le_bytes());
        state.pending.extend_from_slice(payload);
        if state.pending.len() >= PENDING_BYTES {
            state.hasher.update(&state.pending);
            state.pending.clear();
        }
        state.checker.advance();
        Ok(())
    }
}
