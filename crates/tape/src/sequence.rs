//! Checking the sequence of samples of a stream.

use lockstep::time::{SampleTime, Timebase};

use super::{AppendError, SpecError, StreamSpec};

/// Follows one stream sample by sample and rejects every sample that does not fit.
#[derive(Debug)]
pub(crate) struct SequenceChecker {
    spec: StreamSpec,
    timebase: Timebase,
    sample_time: SampleTime,
    next: u64,
}

impl SequenceChecker {
    pub(crate) fn new(spec: StreamSpec) -> Result<SequenceChecker, SpecError> {
        let refuse = |source| SpecError::SampleTime {
            stream: spec.name(),
            source,
        };
        // The stream's own tick: the double nearest to an instant does not depend on the tick.
        let timebase = Timebase::from_times([spec.offset, spec.period]).map_err(refuse)?;
        let sample_time = SampleTime {
            offset: timebase.ceil(spec.offset).map_err(refuse)?,
            period: timebase.ceil(spec.period).map_err(refuse)?,
        };
        Ok(SequenceChecker {
            next: spec.first_index,
            spec,
            timebase,
            sample_time,
        })
    }

    pub(crate) fn spec(&self) -> &StreamSpec {
        &self.spec
    }

    /// How many samples were accepted.
    pub(crate) fn count(&self) -> u64 {
        self.next - self.spec.first_index
    }

    /// Checks a sample; [`SequenceChecker::advance`] must follow once it is stored.
    pub(crate) fn check(&self, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        if index != self.next {
            return Err(AppendError::Index {
                stream: self.spec.name(),
                index,
                expected: self.next,
            });
        }
        let expected = self.spec.descriptor.size as usize;
        if payload.len() != expected {
            return Err(AppendError::Size {
                stream: self.spec.name(),
                index,
                size: payload.len(),
                expected,
            });
        }
        let expected_s = self.timebase.seconds(self.sample_time.instant(index));
        if stamp_s.to_bits() != expected_s.to_bits() {
            return Err(AppendError::Stamp {
                stream: self.spec.name(),
                index,
                stamp_s,
                expected_s,
            });
        }
        Ok(())
    }

    pub(crate) fn advance(&mut self) {
        self.next += 1;
    }

    /// Goes back to `count` accepted samples, or does nothing if there are fewer.
    pub(crate) fn truncate(&mut self, count: u64) {
        self.next = self.next.min(self.spec.first_index + count);
    }
}
