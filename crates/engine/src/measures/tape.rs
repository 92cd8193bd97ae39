//! Measures of a tape that is complete, or was cut short.

use ::tape::{ReadError, Reader, Records, Source};
use lockstep::time::TickError;

use super::{Definition, Measures};
use crate::assessment::Figures;

/// Why a tape cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The tape cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The times of a measure and of its streams have no common tick.
    #[error("measure `{name}`: {source}")]
    Tick {
        /// The measure.
        name: String,
        /// The mistake.
        source: TickError,
    },
}

/// A stream and its next sample.
struct StreamCursor<'a> {
    stream: usize,
    records: Records<'a, Reader>,
    stamp_s: f64,
    payload: Vec<u8>,
    at_end: bool,
}

impl StreamCursor<'_> {
    fn advance(&mut self) -> Result<(), ReadError> {
        match self.records.next()? {
            Some(record) => {
                self.stamp_s = record.stamp_s;
                self.payload.clear();
                self.payload.extend_from_slice(record.payload);
            }
            None => self.at_end = true,
        }
        Ok(())
    }
}

/// The figures of `definitions`, whose readings refer to the streams of `tape`. The streams are read in parallel in the
/// order of their stamps, so that only a few samples are in memory.
///
/// # Errors
/// When the tape cannot be read, or a measure has no common tick.
pub fn of_tape(definitions: Vec<Definition>, tape: &Reader) -> Result<Figures, MeasureError> {
    let mut measures =
        Measures::new(definitions, tape.streams()).map_err(|(name, source)| MeasureError::Tick { name, source })?;
    let mut cursors = Vec::new();
    for stream in (0..tape.streams().len()).filter(|&stream| measures.reads(stream)) {
        let mut cursor = StreamCursor {
            stream,
            records: Records::new(tape, stream),
            stamp_s: 0.0,
            payload: Vec::new(),
            at_end: false,
        };
        cursor.advance()?;
        cursors.push(cursor);
    }
    loop {
        let running = cursors.iter_mut().filter(|cursor| !cursor.at_end);
        let Some(next) = running.min_by(|a, b| a.stamp_s.total_cmp(&b.stamp_s)) else {
            break;
        };
        measures.sample(next.stream, next.stamp_s, &next.payload);
        next.advance()?;
    }
    Ok(Figures::default().with(measures.finish()))
}
