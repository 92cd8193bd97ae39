//! What is kept of each stream of a run, where that is not everything.

use lockstep::time::Ticks;
use tape::StreamSpec;

/// What is kept of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kept {
    /// Every so manyth sample of the stream, counted from its first.
    every: u64,
    /// Of these the ones with the numbers from `first` to before `end`.
    first: u64,
    end: u64,
}

impl Kept {
    /// Every sample.
    pub const WHOLE: Kept = Kept::part(1, 0, u64::MAX);
    /// No sample: the stream is not on the tape.
    pub const NOTHING: Kept = Kept::part(1, 0, 0);

    /// Of every `every`th sample those from number `first` to before `end`.
    pub const fn part(every: u64, first: u64, end: u64) -> Kept {
        Kept { every, first, end }
    }

    /// Whether nothing is left out.
    pub fn is_whole(self) -> bool {
        self == Kept::WHOLE
    }

    /// Whether there is nothing of it.
    pub fn is_nothing(self) -> bool {
        self == Kept::NOTHING
    }

    /// The number on the tape of sample `index`, if it is kept.
    #[inline]
    pub(super) fn number(self, index: u64) -> Option<u64> {
        let number = index / self.every;
        (index.is_multiple_of(self.every) && (self.first..self.end).contains(&number)).then_some(number)
    }

    /// The stream as it is on the tape; `None` when it is not there.
    pub(super) fn spec(self, spec: &StreamSpec) -> Option<StreamSpec> {
        if self.is_nothing() {
            return None;
        }
        let mut spec = spec.clone();
        // It was a whole number of periods in the scenario.
        spec.period = i64::try_from(self.every)
            .ok()
            .and_then(|every| spec.period.checked_mul(every))?;
        spec.first_index = self.first;
        Some(spec)
    }

    /// What is on the tape, in words; nothing where that is everything.
    pub fn words(self, spec: &StreamSpec) -> Option<String> {
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
        if self.every > 1 {
            words += &format!(" every {}", kept.period);
        }
        if let Some(from) = instant(self.first).filter(|_| self.first > 0) {
            words += &format!(" from {from}");
        }
        if self.end == 0 {
            words += " before its first sample";
        } else if let Some(to) = instant(self.end - 1).filter(|_| self.end < u64::MAX) {
            words += &format!(" to {to}");
        }
        Some(words)
    }
}
