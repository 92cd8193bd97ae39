//! Which samples of a stream are observed, apart from the inputs that read it.

use serde::{Deserialize, Serialize};

/// The samples of a stream that go to the tape, a measure, an assessment, a guard or a program that asks for them: of every `every`th
/// sample, counted from sample 0, those with the numbers from `first` up to, but not including, `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Observed {
    /// The distance between two observed samples, at least 1.
    pub every: u64,
    /// The number of the first one.
    pub first: u64,
    /// The number after the last one.
    pub end: u64,
}

impl Observed {
    /// Every sample.
    pub const ALL: Observed = Observed {
        every: 1,
        first: 0,
        end: u64::MAX,
    };
    /// No sample.
    pub const NONE: Observed = Observed {
        every: 1,
        first: 0,
        end: 0,
    };

    /// Whether no sample is observed.
    pub fn is_empty(self) -> bool {
        self.first >= self.end
    }

    /// The number of sample `index` among the observed ones, if it is one of them.
    #[inline]
    pub fn number(self, index: u64) -> Option<u64> {
        let number = match self.every {
            // This is the usual case. A value from another process may be zero.
            0 | 1 => index,
            every if index.is_multiple_of(every) => index / every,
            _ => return None,
        };
        (self.first..self.end).contains(&number).then_some(number)
    }

    /// Whether sample `index` is observed.
    #[inline]
    pub fn contains(self, index: u64) -> bool {
        self.number(index).is_some()
    }

    /// All samples that `self` or `other` observes, and possibly more: every sample where the two differ and neither is empty.
    #[must_use]
    pub fn union(self, other: Observed) -> Observed {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => other,
            (_, true) => self,
            _ if self == other => self,
            _ => Observed::ALL,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn observed_part_contains_every_nth_sample() {
        let part = Observed {
            every: 4,
            first: 2,
            end: 5,
        };
        let of = |part: Observed| (0..40).filter(|&index| part.contains(index)).collect::<Vec<_>>();
        assert_eq!(of(part), [8, 12, 16]);
        assert_eq!(of(Observed::ALL).len(), 40);
        assert!(of(Observed::NONE).is_empty() && Observed::NONE.is_empty());
    }

    #[test]
    fn union_contains_samples_of_both() {
        let parts = [
            Observed::ALL,
            Observed::NONE,
            Observed {
                every: 4,
                first: 2,
                end: 5,
            },
            Observed {
                every: 3,
                first: 0,
                end: 9,
            },
        ];
        for (a, b) in parts.iter().flat_map(|a| parts.iter().map(move |b| (*a, *b))) {
            let missing =
                (0..100).find(|&index| (a.contains(index) || b.contains(index)) && !a.union(b).contains(index));
            assert_eq!(missing, None, "{a:?} or {b:?}");
        }
        assert_eq!(parts[1].union(parts[2]), parts[2]);
    }
}
