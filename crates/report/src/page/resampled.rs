//! Resampling of a stream at the instants of another one, by the delivery rule: the newest sample stamped at or before.

use lockstep::time::{SampleTime, Timebase};
use tape::{ReadError, Source, StreamSpec, split_record};

/// Number of records read at a time.
const BLOCK: u64 = 256;

/// One stream resampled at the samples of a leading stream.
pub(super) struct Resampled<'a> {
    source: &'a dyn Source,
    stream: usize,
    /// The instants of the leading stream and of this one, in common ticks; `None` where the ticks exceed 63 bits.
    times: Option<(SampleTime, SampleTime)>,
    first_index: u64,
    count: u64,
    stride: usize,
    /// The buffer holds the records from `start` on.
    start: u64,
    buffer: Vec<u8>,
}

impl<'a> Resampled<'a> {
    /// Stream number `stream` of `source` at the instants of `lead`, which may belong to another run.
    pub(super) fn new(source: &'a dyn Source, stream: usize, lead: &StreamSpec) -> Resampled<'a> {
        let spec = &source.streams()[stream];
        let times = || {
            let base = Timebase::from_times([lead.offset, lead.period, spec.offset, spec.period]).ok()?;
            let of = |spec: &StreamSpec| {
                Some(SampleTime {
                    offset: base.ceil(spec.offset).ok()?,
                    period: base.ceil(spec.period).ok()?,
                })
            };
            Some((of(lead)?, of(spec)?))
        };
        Resampled {
            times: times(),
            first_index: spec.first_index,
            count: source.count(stream),
            stride: spec.stride(),
            start: 0,
            buffer: Vec::new(),
            source,
            stream,
        }
    }

    /// The payload that is visible at sample `index` of the leading stream; `None` before the first sample, and where the
    /// stream ended more than a period before.
    pub(super) fn at(&mut self, index: u64) -> Result<Option<&[u8]>, ReadError> {
        let newest = self
            .times
            .and_then(|(lead, own)| own.index_at_or_before(lead.instant(index)));
        let Some(record) = newest.and_then(|newest| newest.checked_sub(self.first_index)) else {
            return Ok(None);
        };
        if self.count == 0 || record > self.count {
            return Ok(None);
        }
        let record = record.min(self.count - 1);
        let held = (self.buffer.len() / self.stride) as u64;
        if record < self.start || record >= self.start + held {
            let wanted = BLOCK.min(self.count - record) as usize;
            self.buffer.resize(wanted * self.stride, 0);
            self.source.read(self.stream, record, &mut self.buffer)?;
            self.start = record;
        }
        let at = (record - self.start) as usize * self.stride;
        Ok(Some(split_record(&self.buffer[at..at + self.stride], 0).payload))
    }
}
