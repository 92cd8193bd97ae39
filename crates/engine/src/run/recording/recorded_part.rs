//! Which samples of each stream a run keeps, if not all.

use lockstep::plan::Observed;
use lockstep::time::Ticks;
use tape::StreamSpec;

/// Which samples of a stream are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordedPart(Observed);

impl RecordedPart {
    /// Every sample.
    pub const WHOLE: RecordedPart = RecordedPart(Observed::ALL);
    /// No sample: the stream is not on the tape.
    pub const NOTHING: RecordedPart = RecordedPart(Observed::NONE);

    /// Of every `every`th sample, those from number `first` to before `end`.
    pub const fn part(every: u64, first: u64, end: u64) -> RecordedPart {
        RecordedPart(Observed { every, first, end })
    }

    /// Whether all samples are recorded.
    pub fn is_whole(self) -> bool {
        self == RecordedPart::WHOLE
    }

    /// Whether no sample is recorded.
    pub fn is_nothing(self) -> bool {
        self == RecordedPart::NOTHING
    }

    /// The samples that are recorded.
    pub(crate) fn observed(self) -> Observed {
        self.0
    }

    /// The number on the tape of sample `index`, if it is recorded.
    #[inline]
    pub(crate) fn number(self, index: u64) -> Option<u64> {
        self.0.number(index)
    }

    /// How many of the first `samples` samples are recorded.
    pub(crate) fn of_first(self, samples: u64) -> u64 {
        let Observed { every, first, end } = self.0;
        samples.div_ceil(every.max(1)).min(end).saturating_sub(first)
    }

    /// The stream as it is on the tape; `None` when it is not there.
    pub(crate) fn spec(self, spec: &StreamSpec) -> Option<StreamSpec> {
        if self.is_nothing() {
            return None;
        }
        let mut spec = spec.clone();
        // The scenario requires a whole number of periods.
        spec.period = i64::try_from(self.0.every)
            .ok()
            .and_then(|every| spec.period.checked_mul(every))?;
        spec.first_index = self.0.first;
        Some(spec)
    }

    /// What is on the tape, for messages; `None` if it has every sample.
    pub fn describe(self, spec: &StreamSpec) -> Option<String> {
        if self.is_whole() {
            return None;
        }
        let Some(kept) = self.spec(spec) else {
            return Some(format!("nothing of `{}`", spec.name()));
        };
        let instant = |number: u64| {
            let number = Ticks::try_from(number).ok()?;
            kept.period.checked_mul(number)?.checked_add(kept.offset)
        };
        let mut words = format!("`{}`", spec.name());
        if self.0.every > 1 {
            words += &format!(" every {}", kept.period);
        }
        if let Some(from) = instant(self.0.first).filter(|_| self.0.first > 0) {
            words += &format!(" from {from}");
        }
        if self.0.end == 0 {
            words += " before its first sample";
        } else if let Some(to) = instant(self.0.end - 1).filter(|_| self.0.end < u64::MAX) {
            words += &format!(" to {to}");
        }
        Some(words)
    }
}
