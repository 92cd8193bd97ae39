//! The rule of visibility: a sample stamped s on a link with delay d is visible at t exactly when s + d <= t.

use serde::{Deserialize, Serialize};

use crate::random::Stream;
use crate::time::{Rational, SampleTime, Ticks, Timebase};

/// What an input sees where the newest sample did not come through.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// The newest sample that did (zero-order hold).
    #[default]
    Last,
    /// The link's initial value, until a sample comes through again ("zeroing" where that value is zero).
    Initial,
}

/// The timing of a link as the user gives it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The fixed part of the delay, s.
    pub delay: Rational,
    /// The random part: each sample is late by an extra time that is uniform in [0, jitter), s.
    pub jitter: Rational,
    /// The probability in [0, 1] that a sample never arrives.
    pub drop: f64,
    /// What an input sees instead of a dropped sample.
    pub hold: Hold,
}

impl Default for Rational {
    fn default() -> Self {
        Rational::ZERO
    }
}

/// Why a link's timing cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TimingError {
    /// A delay or a jitter below zero would let an input see the future.
    #[error("{what} is {value}: it must not be negative")]
    Negative {
        /// `delay` or `jitter`.
        what: &'static str,
        /// Its value.
        value: Rational,
    },
    /// A probability outside [0, 1].
    #[error("drop is {0}: a probability lies between 0 and 1")]
    Probability(f64),
    /// The fractions are too fine.
    #[error("delay {delay} and jitter {jitter} need more than 127 bits against the tick: write them with fewer digits")]
    Precision {
        /// The delay.
        delay: Rational,
        /// The jitter.
        jitter: Rational,
    },
}

/// A link's rule of visibility against the tick of a plan: a pure function of the scenario and the run's seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Visibility {
    /// When the samples are stamped: sample k carries the instant k of this sample time.
    producer: SampleTime,
    /// The delay of a sample with draw r is ceil((base + spread * r) / scale) ticks, r in [0, 2^32).
    base: i128,
    spread: i128,
    scale: i128,
    /// A sample is dropped when its draw lies below this; 2^32 drops all.
    drop_below: u64,
    hold: Hold,
    random: Stream,
}

const DRAWS: i128 = 1 << 32;

impl Visibility {
    /// The rule for a link called `link` that carries the samples of `producer`.
    pub fn new(
        timing: &Timing,
        producer: SampleTime,
        timebase: &Timebase,
        seed: u64,
        link: &str,
    ) -> Result<Visibility, TimingError> {
        for (what, value) in [("delay", timing.delay), ("jitter", timing.jitter)] {
            if value.is_negative() {
                return Err(TimingError::Negative { what, value });
            }
        }
        if !(0.0..=1.0).contains(&timing.drop) {
            return Err(TimingError::Probability(timing.drop));
        }
        let (base, spread, scale) = Self::coefficients(timing, timebase).ok_or(TimingError::Precision {
            delay: timing.delay,
            jitter: timing.jitter,
        })?;
        Ok(Visibility {
            producer,
            base,
            spread,
            scale,
            drop_below: (timing.drop * DRAWS as f64) as u64,
            hold: timing.hold,
            random: Stream::new(seed, &format!("link {link}")),
        })
    }

    /// With tick a/b, delay c/d and jitter e/f: delay + jitter r / 2^32 = (c D/d 2^32 + e D/f r) / (D 2^32) where D is a
    /// common denominator, and ticks are that times b/a. A common factor of the three changes nothing.
    fn coefficients(timing: &Timing, timebase: &Timebase) -> Option<(i128, i128, i128)> {
        let (d, f) = (
            i128::from(timing.delay.denominator()),
            i128::from(timing.jitter.denominator()),
        );
        let common = d / crate::time::gcd(d, f) * f;
        let tick = timebase.tick();
        let per_tick = i128::from(tick.denominator());
        let base = (common / d)
            .checked_mul(i128::from(timing.delay.numerator()))?
            .checked_mul(per_tick)?
            .checked_mul(DRAWS)?;
        let spread = (common / f)
            .checked_mul(i128::from(timing.jitter.numerator()))?
            .checked_mul(per_tick)?;
        let scale = common.checked_mul(i128::from(tick.numerator()))?.checked_mul(DRAWS)?;
        // The largest value ever formed must fit, and the largest delay must be a tick count.
        let largest = base.checked_add(spread.checked_mul(DRAWS)?)?.checked_add(scale)?;
        let shared = crate::time::gcd(crate::time::gcd(base, spread), scale).max(1);
        (largest / scale < 1 << 62).then_some((base / shared, spread / shared, scale / shared))
    }

    /// The sample time of the producer.
    pub fn producer(&self) -> SampleTime {
        self.producer
    }

    /// The delay of sample `k`, ticks: `s + d <= t` and `s + ceil(d) <= t` are the same for whole ticks s and t.
    pub fn delay(&self, k: u64) -> Ticks {
        let draw = if self.spread == 0 {
            0
        } else {
            i128::from(self.random.bits(2 * k) >> 32)
        };
        self.delay_at(draw)
    }

    fn delay_at(&self, draw: i128) -> Ticks {
        let ticks = self.base + self.spread * draw;
        (ticks / self.scale + i128::from(ticks % self.scale != 0)) as Ticks
    }

    /// The least and the largest delay that any sample can have, ticks.
    pub fn delay_bounds(&self) -> (Ticks, Ticks) {
        (
            self.delay_at(0),
            self.delay_at(if self.spread == 0 { 0 } else { DRAWS - 1 }),
        )
    }

    /// True when sample `k` never arrives.
    pub fn dropped(&self, k: u64) -> bool {
        self.drop_below > 0 && (self.random.bits(2 * k + 1) >> 32) < self.drop_below
    }

    /// What an input sees in place of a dropped sample.
    pub fn hold(&self) -> Hold {
        self.hold
    }

    /// The instant from which sample `k` can be seen, if it ever can, ticks.
    pub fn visible_from(&self, k: u64) -> Option<Ticks> {
        (!self.dropped(k)).then(|| self.producer.instant(k).saturating_add(self.delay(k)))
    }
}
