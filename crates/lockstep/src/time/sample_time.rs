//! Sample times and the plan's integer tick.

use serde::{Deserialize, Serialize};

use super::Rational;
use super::rational::{gcd, nearest_double, quotient};

/// A count of ticks of a [`Timebase`]: an instant or a duration.
pub type Ticks = i64;

/// The plan's unit of time: every period and offset of a run is a whole number of ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timebase {
    tick: Rational,
}

/// Why a set of times has no usable common tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TickError {
    /// The times have no common measure that is a 63-bit fraction.
    #[error(
        "the periods and offsets have no common measure that fits 63 bits: choose times with a smaller common denominator"
    )]
    NoCommonMeasure,
    /// An instant lies beyond 2^62 ticks.
    #[error(
        "{time} is more than 2^62 ticks of {tick}: shorten the run or choose periods with a smaller common denominator"
    )]
    TooManyTicks {
        /// The instant.
        time: Rational,
        /// The tick.
        tick: Rational,
    },
}

impl Timebase {
    /// The largest common measure of `times` (zeros are ignored; one second when nothing is left).
    pub fn from_times(times: impl IntoIterator<Item = Rational>) -> Result<Timebase, TickError> {
        let mut tick: Option<Rational> = None;
        for time in times.into_iter().filter(|time| *time != Rational::ZERO) {
            tick = Some(match tick {
                None => time.common_measure(time).ok_or(TickError::NoCommonMeasure)?,
                Some(tick) => tick.common_measure(time).ok_or(TickError::NoCommonMeasure)?,
            });
        }
        Ok(Timebase {
            tick: tick.unwrap_or(Rational::from_millis(1000)),
        })
    }

    /// The length of one tick, s.
    pub fn tick(&self) -> Rational {
        self.tick
    }

    /// The first whole tick at or after `time`. For an instant t on the tick grid, `t >= time` and `t >= ceil(time)` are equivalent, so
    /// delays and ends of runs need not be multiples of the tick.
    pub fn ceil(&self, time: Rational) -> Result<Ticks, TickError> {
        let n = i128::from(time.numerator()) * i128::from(self.tick.denominator());
        let d = i128::from(time.denominator()) * i128::from(self.tick.numerator());
        let ticks = n.div_euclid(d) + i128::from(n.rem_euclid(d) != 0);
        if ticks.unsigned_abs() > 1 << 62 {
            return Err(TickError::TooManyTicks { time, tick: self.tick });
        }
        Ok(ticks as Ticks)
    }

    /// The double nearest to `ticks` in seconds: one rounding, never a running sum.
    #[inline]
    pub fn seconds(&self, ticks: Ticks) -> f64 {
        let (n, d) = (self.tick.numerator(), self.tick.denominator());
        let short = ticks.checked_mul(n).and_then(|n| quotient(n, d));
        short.unwrap_or_else(|| nearest_double(i128::from(ticks) * i128::from(n), i128::from(d)))
    }

    /// The exact instant; `None` when it needs more than 63 bits.
    pub fn time(&self, ticks: Ticks) -> Option<Rational> {
        self.tick.checked_mul(ticks)
    }
}

/// The instants `offset + k * period`, k = 0, 1, 2, …, in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleTime {
    /// The first instant.
    pub offset: Ticks,
    /// The distance between two instants, positive.
    pub period: Ticks,
}

impl SampleTime {
    /// The instant of activation `k`; saturates at the end of representable time.
    #[inline]
    pub fn instant(&self, k: u64) -> Ticks {
        let exact = Ticks::try_from(k).ok().and_then(|k| self.period.checked_mul(k));
        exact
            .and_then(|exact| exact.checked_add(self.offset))
            .unwrap_or(Ticks::MAX)
    }

    /// How many instants lie before `end`.
    pub fn count_before(&self, end: Ticks) -> u64 {
        let span = i128::from(end) - i128::from(self.offset);
        if span <= 0 {
            0
        } else {
            ((span - 1) / i128::from(self.period) + 1) as u64
        }
    }

    /// The largest index whose instant is at or before `t`.
    pub fn index_at_or_before(&self, t: Ticks) -> Option<u64> {
        // The distance between the two ends of representable time exceeds a signed word, but not an unsigned one.
        (t >= self.offset).then(|| t.abs_diff(self.offset) / self.period.unsigned_abs())
    }

    /// The instants that two sample times have in common, as a sample time (Chinese remainder theorem); `None` when they have none, or
    /// none within representable time.
    pub fn intersection(&self, other: &SampleTime) -> Option<SampleTime> {
        let (p, q) = (i128::from(self.period), i128::from(other.period));
        let common = gcd(p, q);
        let distance = i128::from(other.offset) - i128::from(self.offset);
        if distance % common != 0 {
            return None;
        }
        let modulus = q / common;
        let steps = ((distance / common) % modulus * inverse(p / common, modulus)).rem_euclid(modulus);
        let period = p / common * q;
        let mut first = i128::from(self.offset) + steps * p;
        let latest_start = i128::from(self.offset.max(other.offset));
        if first < latest_start {
            first += (latest_start - first + period - 1) / period * period;
        }
        Some(SampleTime {
            offset: Ticks::try_from(first).ok()?,
            // A period beyond representable time means that they have one instant in common.
            period: Ticks::try_from(period).unwrap_or(Ticks::MAX),
        })
    }
}

/// The inverse of `a` modulo `m`, for coprime `a` and `m` (extended Euclid).
fn inverse(a: i128, m: i128) -> i128 {
    let (mut r0, mut r1, mut s0, mut s1) = (a.rem_euclid(m), m, 1, 0);
    while r1 != 0 {
        let quotient = r0 / r1;
        (r0, r1) = (r1, r0 - quotient * r1);
        (s0, s1) = (s1, s0 - quotient * s1);
    }
    s0.rem_euclid(m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn tick_is_common_measure_of_odd_rates() {
        let base = Timebase::from_times(["1 ms", "30 Hz", "1/300 s"].map(|t| t.parse().unwrap())).unwrap();
        assert_eq!(base.tick(), "1/3000 s".parse().unwrap());
        assert_eq!(base.ceil("30 Hz".parse().unwrap()).unwrap(), 100);
        assert_eq!(base.ceil("0.1 ms".parse().unwrap()).unwrap(), 1);
        assert_eq!(base.ceil("-0.1 ms".parse().unwrap()).unwrap(), 0);
    }

    #[test]
    fn sample_time_has_no_drift_after_hours() {
        let base = Timebase::from_times(["1 ms".parse().unwrap()]).unwrap();
        assert_eq!(base.seconds(256_040), 256.040);
        assert_eq!(base.seconds(36_000_001), 36_000.001);
    }

    proptest! {
        #[test]
        fn sample_time_intersection_equals_search(
            (o1, p1, o2, p2) in (0_i64..60, 1_i64..40, 0_i64..60, 1_i64..40)
        ) {
            let (a, b) = (SampleTime { offset: o1, period: p1 }, SampleTime { offset: o2, period: p2 });
            let searched: Vec<i64> = (0..4000)
                .filter(|t| *t >= o1 && *t >= o2 && (t - o1) % p1 == 0 && (t - o2) % p2 == 0)
                .collect();
            let common: Vec<i64> = a.intersection(&b).map_or(Vec::new(), |m| {
                (0..).map(|k| m.instant(k)).take_while(|t| *t < 4000).collect()
            });
            prop_assert_eq!(common, searched);
        }

        #[test]
        fn sample_time_counts_match_indices(offset in -50_i64..50, period in 1_i64..20, end in -60_i64..300) {
            let sample_time = SampleTime { offset, period };
            let counted = (0..).map(|k| sample_time.instant(k)).take_while(|t| *t < end).count() as u64;
            prop_assert_eq!(sample_time.count_before(end), counted);
            prop_assert_eq!(sample_time.index_at_or_before(end - 1), counted.checked_sub(1));
        }
    }
}
