//! The off-tape state of a checkpoint: the data that is needed to resume a run and is not on its tape.

use lockstep::plan::InFlightSample;
use serde::{Deserialize, Serialize};

use crate::run::recording::guard;

/// What a checkpoint holds besides the states when `[record]` leaves samples out of the tape.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct OffTapeState {
    /// How many samples of each stream the tape has.
    pub counts: Vec<u64>,
    /// For each stream, the samples that are still needed and are not on the tape, oldest first. Their stamps follow from their
    /// indices.
    pub samples: Vec<Vec<InFlightSample>>,
    /// The state of the assessment and the measures.
    pub assessment: Option<Vec<u8>>,
    /// The state of each guard.
    pub guards: Vec<guard::SavedGuard>,
}

impl OffTapeState {
    /// The payload of a sample, if this holds it.
    pub(crate) fn payload(&self, stream: usize, index: u64) -> Option<&[u8]> {
        find(self.samples.get(stream)?, index)
    }
}

/// Below this many bytes of samples, the samples that are no longer needed are not looked for.
const CLEANUP_BYTES: usize = 1 << 20;

/// The newest samples of the streams of which the tape leaves samples out, and the older ones that are still needed.
pub(crate) struct SampleBuffer {
    /// For each stream; `None` where the tape has every sample.
    tracks: Vec<Option<BufferedStream>>,
    /// How many bytes of newest samples there are.
    bytes: usize,
    /// Above this many bytes the samples that are no longer needed are dropped.
    limit: usize,
}

/// Samples of one stream.
struct BufferedStream {
    size: usize,
    /// The samples before `first` that are still needed.
    old: Vec<InFlightSample>,
    /// The index of the first of `count` samples in a row.
    first: u64,
    count: u64,
    newest: Vec<u8>,
}

impl SampleBuffer {
    /// For streams with payloads of these sizes; `None` for a stream that is not buffered.
    pub(crate) fn new(sizes: impl Iterator<Item = Option<usize>>) -> SampleBuffer {
        let track = |size| BufferedStream {
            size,
            old: Vec::new(),
            first: 0,
            count: 0,
            newest: Vec::new(),
        };
        SampleBuffer {
            tracks: sizes.map(|size| size.map(track)).collect(),
            bytes: 0,
            limit: CLEANUP_BYTES,
        }
    }

    /// Buffers the next sample of a stream.
    #[inline]
    pub(crate) fn put(&mut self, stream: usize, index: u64, payload: &[u8]) {
        let Some(track) = &mut self.tracks[stream] else {
            return;
        };
        if track.count == 0 {
            track.first = index;
        }
        track.count += 1;
        track.newest.extend_from_slice(payload);
        self.bytes += payload.len();
    }

    /// A sample, if it is buffered.
    pub(crate) fn get(&self, stream: usize, index: u64) -> Option<&[u8]> {
        let track = self.tracks.get(stream)?.as_ref()?;
        match index.checked_sub(track.first).filter(|at| *at < track.count) {
            Some(at) => track.newest.get(at as usize * track.size..)?.get(..track.size),
            None => find(&track.old, index),
        }
    }

    /// Whether it is time to drop the samples that are no longer needed.
    pub(crate) fn needs_cleanup(&self) -> bool {
        self.bytes > self.limit
    }

    /// Keeps, of the first `before` samples of each stream, those in `needed` and no others.
    pub(crate) fn keep(&mut self, before: &[u64], needed: &[Vec<InFlightSample>]) {
        self.bytes = 0;
        for (stream, track) in self.tracks.iter_mut().enumerate() {
            let Some(track) = track else { continue };
            let gone = before[stream].saturating_sub(track.first).min(track.count);
            track.newest.drain(..gone as usize * track.size);
            (track.first, track.count) = (track.first + gone, track.count - gone);
            track.old.clone_from(&needed[stream]);
            self.bytes += track.newest.len();
        }
        // While participants are far behind others, most of the samples stay needed for a while.
        self.limit = CLEANUP_BYTES.max(2 * self.bytes);
    }

    /// Goes back: the next samples are those after `needed`.
    pub(crate) fn reset(&mut self, needed: &[Vec<InFlightSample>]) {
        self.bytes = 0;
        for (track, needed) in self.tracks.iter_mut().zip(needed) {
            if let Some(track) = track {
                track.old.clone_from(needed);
                track.newest.clear();
                track.count = 0;
            }
        }
    }
}

fn find(samples: &[InFlightSample], index: u64) -> Option<&[u8]> {
    let at = samples.binary_search_by_key(&index, |sample| sample.index).ok()?;
    Some(&samples[at].payload)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_buffer_keeps_needed_samples_after_cleanup() {
        let mut recent = SampleBuffer::new([Some(2), None].into_iter());
        for index in 3..10_u8 {
            recent.put(0, index.into(), &[index, 1]);
            recent.put(1, index.into(), &[index]);
        }
        assert_eq!(recent.get(0, 3), Some(&[3, 1][..]));
        assert_eq!(
            (recent.get(0, 2), recent.get(0, 10), recent.get(1, 4)),
            (None, None, None)
        );
        let sample = |index: u8| InFlightSample {
            index: index.into(),
            payload: vec![index, 1],
        };
        recent.keep(&[7, 0], &[vec![sample(3), sample(6)], Vec::new()]);
        let there: Vec<u64> = (0..12).filter(|index| recent.get(0, *index).is_some()).collect();
        assert_eq!(there, [3, 6, 7, 8, 9]);
        assert_eq!(recent.get(0, 8), Some(&[8, 1][..]));
        recent.reset(&[vec![sample(3)], Vec::new()]);
        recent.put(0, 5, &[5, 1]);
        let there: Vec<u64> = (0..12).filter(|index| recent.get(0, *index).is_some()).collect();
        assert_eq!(there, [3, 5]);
        assert!(!recent.needs_cleanup());
        (0..1 << 19).for_each(|index| recent.put(0, 6 + index, &[0, 1]));
        assert!(recent.needs_cleanup());
    }
}
