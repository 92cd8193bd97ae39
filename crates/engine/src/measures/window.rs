//! Windows in whole ticks: the samples in a window, and the sample of another stream at an instant.

use lockstep::time::{Rational, SampleTime, TickError, Ticks, Timebase};
use serde::{Deserialize, Serialize};

/// The samples of a stream, by their indices, that lie in a window. Times are never compared as doubles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Window {
    first: u64,
    /// The first one after the window.
    end: u64,
}

/// The ticks of all streams that a measure reads, and of its own instants.
pub(super) fn timebase(times: impl IntoIterator<Item = Rational>) -> Result<Timebase, TickError> {
    Timebase::from_times(times)
}

/// The instants of a stream.
pub(super) fn sample_time(base: &Timebase, offset: Rational, period: Rational) -> Result<SampleTime, TickError> {
    Ok(SampleTime {
        offset: base.ceil(offset)?,
        period: base.ceil(period)?,
    })
}

/// The last tick at or before `time`.
fn floor(base: &Timebase, time: Rational) -> Result<Ticks, TickError> {
    let ceil = base.ceil(time)?;
    Ok(if base.time(ceil) == Some(time) { ceil } else { ceil - 1 })
}

impl Window {
    /// From `from` to `to`, both included.
    pub(super) fn between(
        base: &Timebase,
        samples: SampleTime,
        from: Option<Rational>,
        to: Option<Rational>,
    ) -> Result<Window, TickError> {
        let first = match from {
            Some(from) => samples.count_before(base.ceil(from)?),
            None => 0,
        };
        let end = match to {
            Some(to) => samples
                .index_at_or_before(floor(base, to)?)
                .map_or(0, |index| index.saturating_add(1)),
            None => u64::MAX,
        };
        Ok(Window { first, end })
    }

    /// The newest sample at `at`. Where a sample is due exactly at `at`, also the one before, because a run that ends at
    /// `at` has no newer one.
    pub(super) fn at(base: &Timebase, samples: SampleTime, at: Rational) -> Result<Window, TickError> {
        let now = floor(base, at)?;
        let Some(index) = samples.index_at_or_before(now) else {
            return Ok(Window { first: 0, end: 0 });
        };
        let due = samples.instant(index) == now && base.time(now) == Some(at);
        Ok(Window {
            first: index.saturating_sub(u64::from(due)),
            end: index.saturating_add(1),
        })
    }

    /// The first index at or after `index` that is not before the window.
    pub(super) fn from(&self, index: u64) -> u64 {
        self.first.max(index)
    }

    pub(super) fn contains(&self, index: u64) -> bool {
        (self.first..self.end).contains(&index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time(numerator: i128, denominator: i128) -> Rational {
        Rational::new(numerator, denominator).expect("a fraction")
    }

    #[test]
    fn window_includes_both_ends_exactly() {
        let base = timebase([time(1, 30), time(1, 100)]).unwrap();
        let samples = sample_time(&base, time(1, 100), time(1, 30)).unwrap();
        // stamps 0.01, 0.04333…, 0.07666…, 0.11
        let window = |from, to| Window::between(&base, samples, from, to).unwrap();
        let (a, b) = (time(1, 100), time(11, 100));
        assert_eq!(window(Some(a), Some(b)), Window { first: 0, end: 4 });
        let little = time(1, 1_000_000_007);
        let (late, early) = (
            a.checked_add(little).unwrap(),
            time(11, 100).checked_add(time(-1, 1_000_000_007)).unwrap(),
        );
        assert_eq!(window(Some(late), Some(early)), Window { first: 1, end: 3 });
        assert_eq!(window(None, Some(time(1, 1000))), Window { first: 0, end: 0 });
        assert_eq!(
            window(None, None),
            Window {
                first: 0,
                end: u64::MAX
            }
        );
    }

    #[test]
    fn window_at_instant_has_newest_sample() {
        let base = timebase([time(1, 10)]).unwrap();
        let samples = sample_time(&base, Rational::ZERO, time(1, 10)).unwrap();
        let at = |at| Window::at(&base, samples, at).unwrap();
        assert_eq!(at(time(3, 10)), Window { first: 2, end: 4 });
        assert_eq!(at(time(35, 100)), Window { first: 3, end: 4 });
        assert_eq!(at(Rational::ZERO), Window { first: 0, end: 1 });
    }
}
