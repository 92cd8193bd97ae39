//! Tapes without files, for campaigns and tests.

use super::hash::combine;
use super::spec::validate_all;
use super::track::Track;
use super::{AppendError, Digest, ReadError, Sink, Source, SpecError, StreamSpec};

fn tracks(streams: Vec<StreamSpec>) -> Result<Vec<Track>, SpecError> {
    validate_all(&streams)?;
    streams.into_iter().map(Track::new).collect()
}

/// A tape in memory. It grows with its samples: the only sink that allocates. The default one has no streams.
#[derive(Debug, Default)]
pub struct MemoryTape {
    streams: Vec<StreamSpec>,
    lanes: Vec<(Track, Vec<u8>)>,
}

impl MemoryTape {
    /// An empty tape of these streams.
    pub fn new(streams: Vec<StreamSpec>) -> Result<MemoryTape, SpecError> {
        let lanes = tracks(streams.clone())?.into_iter().map(|track| (track, Vec::new()));
        Ok(MemoryTape {
            lanes: lanes.collect(),
            streams,
        })
    }

    /// Keeps the first `counts` samples of each stream, in the order of their numbers, and discards the rest.
    pub fn cut_back(&mut self, counts: &[u64]) {
        for ((track, bytes), &count) in self.lanes.iter_mut().zip(counts) {
            track.cut_back(count);
            bytes.truncate(track.count() as usize * track.spec().stride());
        }
    }
}

impl Sink for MemoryTape {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.lanes.len();
        let (track, bytes) = self
            .lanes
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        track.check(index, stamp_s, payload)?;
        bytes.extend_from_slice(&stamp_s.to_le_bytes());
        bytes.extend_from_slice(payload);
        track.advance();
        Ok(())
    }
}

impl Source for MemoryTape {
    fn streams(&self) -> &[StreamSpec] {
        &self.streams
    }

    fn count(&self, stream: usize) -> u64 {
        self.lanes[stream].0.count()
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        let stride = self.check_range(stream, first, records.len())?;
        let start = first as usize * stride;
        records.copy_from_slice(&self.lanes[stream].1[start..start + records.len()]);
        Ok(())
    }
}

/// Keeps only the hash: shows whether a run has the same tape as another, without a copy of the tape in memory or on disk.
#[derive(Debug)]
pub struct DigestSink {
    lanes: Vec<HashLane>,
}

#[derive(Debug)]
struct HashLane {
    track: Track,
    hasher: blake3::Hasher,
    /// Records are hashed in batches, which is several times faster than one by one.
    pending: Vec<u8>,
}

/// The size of a batch, bytes.
const PENDING_BYTES: usize = 1 << 14;

impl DigestSink {
    /// A sink for these streams.
    pub fn new(streams: Vec<StreamSpec>) -> Result<DigestSink, SpecError> {
        let lanes = tracks(streams)?.into_iter().map(|track| HashLane {
            pending: Vec::with_capacity(PENDING_BYTES + track.spec().stride()),
            hasher: blake3::Hasher::new(),
            track,
        });
        Ok(DigestSink { lanes: lanes.collect() })
    }

    /// The digest that a tape of all samples so far would have.
    pub fn digest(&self) -> Digest {
        combine(self.lanes.iter().map(|lane| {
            let mut hasher = lane.hasher.clone();
            hasher.update(&lane.pending);
            (lane.track.spec(), lane.track.count(), hasher.finalize().into())
        }))
    }
}

impl Sink for DigestSink {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.lanes.len();
        let lane = self
            .lanes
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        lane.track.check(index, stamp_s, payload)?;
        lane.pending.extend_from_slice(&stamp_s.to_le_bytes());
        lane.pending.extend_from_slice(payload);
        if lane.pending.len() >= PENDING_BYTES {
            lane.hasher.update(&lane.pending);
            lane.pending.clear();
        }
        lane.track.advance();
        Ok(())
    }
}
