//! A selection of streams of a tape, up to given lengths, as a tape.

use super::{ReadError, Source, StreamSpec};

/// Streams of another source.
pub struct Selection<'a, S: Source + ?Sized> {
    source: &'a S,
    streams: Vec<StreamSpec>,
    /// Their numbers in the source, and the number of records shown of each.
    selected: Vec<(usize, u64)>,
}

impl<'a, S: Source + ?Sized> Selection<'a, S> {
    /// The streams with these numbers, each with its number of records.
    ///
    /// # Panics
    /// When there is no such stream.
    pub fn new(source: &'a S, selected: Vec<(usize, u64)>) -> Selection<'a, S> {
        let streams = selected.iter().map(|&(stream, _)| source.streams()[stream].clone());
        Selection {
            streams: streams.collect(),
            source,
            selected,
        }
    }
}

impl<S: Source + ?Sized> Source for Selection<'_, S> {
    fn streams(&self) -> &[StreamSpec] {
        &self.streams
    }

    fn count(&self, stream: usize) -> u64 {
        let (at, limit) = self.selected[stream];
        self.source.count(at).min(limit)
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        self.check_range(stream, first, records.len())?;
        self.source.read(self.selected[stream].0, first, records)
    }
}
