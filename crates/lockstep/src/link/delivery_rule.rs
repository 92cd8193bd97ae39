//! The delivery rule: a sample stamped s on a link with delay d is visible at t exactly when s + d <= t.

use serde::{Deserialize, Serialize};

use crate::fault::LinkFault;
use crate::random::Stream;
use crate::time::{Rational, SampleTime, TickError, Ticks, Timebase, gcd, nearest_double};

/// The value of an input where the newest sample was dropped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// The newest sample that arrived (zero-order hold).
    #[default]
    Last,
    /// The link's initial value, until a sample arrives again ("zeroing" where that value is zero).
    Initial,
    /// Linear interpolation between two samples, at the time of reading minus the delay. The delay is then a shift of the signal: samples
    /// arrive without it, as late as jitter and faults make them.
    Linear,
}

/// The timing of a link as the user wrote it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// The fixed part of the delay, s.
    pub delay: Rational,
    /// The random part: each sample is late by an extra time that is uniform in [0, jitter), s.
    pub jitter: Rational,
    /// The probability in [0, 1] that a sample never arrives.
    pub drop: f64,
    /// The value of an input in place of a dropped sample.
    pub hold: Hold,
}

impl Default for Rational {
    fn default() -> Self {
        Rational::ZERO
    }
}

/// Why a link's timing cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    #[error("drop is {0}, which is not a probability: write a value between 0 and 1")]
    Probability(f64),
    /// The fractions are too fine.
    #[error("delay {delay} and jitter {jitter} need more than 127 bits against the tick: write them with fewer digits")]
    Precision {
        /// The delay.
        delay: Rational,
        /// The jitter.
        jitter: Rational,
    },
    /// A fault's times cannot be counted in ticks.
    #[error("fault `{fault}`: {source}")]
    Fault {
        /// The fault.
        fault: String,
        /// Why not.
        source: TickError,
    },
}

/// A link's delivery rule in the ticks of a plan: a pure function of the scenario and the run's seed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeliveryRule {
    /// The instants of the samples: sample k is stamped with the instant k of this sample time.
    producer: SampleTime,
    /// The delay of a sample with draw r is ceil((base + spread * r) / scale) ticks, r in [0, 2^32); with `Hold::Linear`, the larger
    /// one of ceil(base / scale) and ceil(spread * r / scale).
    base: i128,
    spread: i128,
    scale: i128,
    /// A sample is dropped when its draw lies below this; 2^32 drops all.
    drop_below: u64,
    hold: Hold,
    random: Stream,
    faults: Vec<ScheduledLinkFault>,
}

/// A link fault in ticks: it changes the samples stamped from `from` on and before `until`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct ScheduledLinkFault {
    from: Ticks,
    until: Ticks,
    /// Is added to `base` for these samples.
    extra: i128,
    drop_below: u64,
    random: Stream,
}

impl ScheduledLinkFault {
    fn applies_to(&self, stamp: Ticks) -> bool {
        (self.from..self.until).contains(&stamp)
    }
}

const DRAW_RANGE: i128 = 1 << 32;

impl DeliveryRule {
    /// The rule for a link called `link` that carries the samples of `producer` and has the faults `faults`.
    pub fn new(
        timing: &Timing,
        faults: &[LinkFault],
        producer: SampleTime,
        timebase: &Timebase,
        seed: u64,
        link: &str,
    ) -> Result<DeliveryRule, TimingError> {
        for (what, value) in [("delay", timing.delay), ("jitter", timing.jitter)] {
            if value.is_negative() {
                return Err(TimingError::Negative { what, value });
            }
        }
        if !(0.0..=1.0).contains(&timing.drop) {
            return Err(TimingError::Probability(timing.drop));
        }
        for fault in faults {
            if fault.extra_delay.is_negative() {
                return Err(TimingError::Negative {
                    what: "extra-delay",
                    value: fault.extra_delay,
                });
            }
            if !(0.0..=1.0).contains(&fault.drop) {
                return Err(TimingError::Probability(fault.drop));
            }
        }
        let [base, spread, scale, extras @ ..] =
            &Self::coefficients(timing, faults, timebase).ok_or(TimingError::Precision {
                delay: timing.delay,
                jitter: timing.jitter,
            })?[..]
        else {
            unreachable!("three and one for each fault")
        };
        let disruption = |(fault, &extra): (&LinkFault, &i128)| {
            let ticks = |time| {
                timebase.ceil(time).map_err(|source| TimingError::Fault {
                    fault: fault.name.clone(),
                    source,
                })
            };
            Ok(ScheduledLinkFault {
                from: ticks(fault.span.at)?,
                until: fault.span.until.map_or(Ok(Ticks::MAX), ticks)?,
                extra,
                drop_below: (fault.drop * DRAW_RANGE as f64) as u64,
                random: Stream::new(seed, &format!("fault {} {link}", fault.name)),
            })
        };
        Ok(DeliveryRule {
            producer,
            base: *base,
            spread: *spread,
            scale: *scale,
            drop_below: (timing.drop * DRAW_RANGE as f64) as u64,
            hold: timing.hold,
            random: Stream::new(seed, &format!("link {link}")),
            faults: faults.iter().zip(extras).map(disruption).collect::<Result<_, _>>()?,
        })
    }

    /// With tick a/b, delay c/d and jitter e/f: delay + jitter r / 2^32 = (c D/d 2^32 + e D/f r) / (D 2^32) where D is a common
    /// denominator, and ticks are that times b/a. Extra delays of faults are like the delay. A common factor of all changes nothing.
    /// Returns base, spread, scale, and the extra of each fault.
    fn coefficients(timing: &Timing, faults: &[LinkFault], timebase: &Timebase) -> Option<Vec<i128>> {
        let times = [timing.delay, timing.jitter].into_iter();
        let mut times = times.chain(faults.iter().map(|fault| fault.extra_delay));
        let common = times.clone().try_fold(1_i128, |common, time| {
            let own = i128::from(time.denominator());
            (common / gcd(common, own)).checked_mul(own)
        })?;
        let tick = timebase.tick();
        let scaled = |time: Rational| {
            (common / i128::from(time.denominator()))
                .checked_mul(i128::from(time.numerator()))?
                .checked_mul(i128::from(tick.denominator()))
        };
        let base = scaled(times.next()?)?.checked_mul(DRAW_RANGE)?;
        let spread = scaled(times.next()?)?;
        let scale = common
            .checked_mul(i128::from(tick.numerator()))?
            .checked_mul(DRAW_RANGE)?;
        let mut all = vec![base, spread, scale];
        // The largest intermediate value must fit, and the largest delay must be a tick count.
        let mut largest = base.checked_add(spread.checked_mul(DRAW_RANGE)?)?.checked_add(scale)?;
        for extra in times {
            let extra = scaled(extra)?.checked_mul(DRAW_RANGE)?;
            largest = largest.checked_add(extra)?;
            all.push(extra);
        }
        let divisor = all.iter().fold(0, |divisor, &one| gcd(divisor, one)).max(1);
        all.iter_mut().for_each(|one| *one /= divisor);
        (largest / scale < 1 << 62).then_some(all)
    }

    /// The sample time of the producer.
    pub fn producer(&self) -> SampleTime {
        self.producer
    }

    /// The delay of sample `k`, ticks: `s + d <= t` and `s + ceil(d) <= t` are the same for whole ticks s and t.
    pub fn delay(&self, k: u64) -> Ticks {
        self.delay_with(self.draw(k), self.extra_at(k))
    }

    fn draw(&self, k: u64) -> i128 {
        if self.spread == 0 {
            0
        } else {
            i128::from(self.random.bits(2 * k) >> 32)
        }
    }

    /// With [`Hold::Linear`]: the sample towards which an activation at `t` interpolates from sample `k`, which it reads: the next one
    /// that is not lost, if it was taken before `t` and has arrived, and if the value read is not sample `k` itself.
    pub fn interpolation_target(&self, k: u64, t: Ticks) -> Option<u64> {
        let since = i128::from(t) - i128::from(self.producer.instant(k));
        if since == self.base / self.scale && self.base % self.scale == 0 {
            return None;
        }
        let last = self.producer.index_at_or_before(t.checked_sub(1)?)?;
        let next = (k + 1..=last).find(|&next| !self.is_dropped(next))?;
        let late = self.ticks(self.spread * self.draw(next) + self.extra_at(next));
        (self.producer.instant(next).saturating_add(late) <= t).then_some(next)
    }

    /// The interpolation weight: the position of the instant `t` minus the delay between sample `before` (0) and sample `after` (1). It
    /// is the double nearest to the exact fraction, so it does not depend on the length of the tick.
    pub fn weight(&self, t: Ticks, before: u64, after: u64) -> f64 {
        let (from, to) = (self.producer.instant(before), self.producer.instant(after));
        let (since, between) = (i128::from(t) - i128::from(from), i128::from(to) - i128::from(from));
        // The delay is shift / parts ticks, in lowest terms.
        let divisor = gcd(self.base, self.scale);
        let (shift, parts) = (self.base / divisor, self.scale / divisor);
        let exact = || {
            let position = since.checked_mul(parts)?.checked_sub(shift)?;
            Some(nearest_double(position, between.checked_mul(parts)?))
        };
        // More than 127 bits take a delay with a denominator of more than 64 bits against the tick.
        exact().unwrap_or_else(|| {
            let whole = since - shift / parts;
            (whole as f64 - (shift % parts) as f64 / parts as f64) / between as f64
        })
    }

    /// What faults add to the delay of sample `k`, in the unit of `base`.
    fn extra_at(&self, k: u64) -> i128 {
        if self.faults.is_empty() {
            return 0;
        }
        self.extra_at_stamp(self.producer.instant(k))
    }

    fn extra_at_stamp(&self, stamp: Ticks) -> i128 {
        let active = self.faults.iter().filter(|fault| fault.applies_to(stamp));
        active.map(|fault| fault.extra).sum()
    }

    fn delay_with(&self, draw: i128, extra: i128) -> Ticks {
        let late = extra + self.spread * draw;
        match self.hold {
            Hold::Last | Hold::Initial => self.ticks(self.base + late),
            Hold::Linear => self.ticks(self.base).max(self.ticks(late)),
        }
    }

    /// Rounded up.
    fn ticks(&self, scaled: i128) -> Ticks {
        (scaled / self.scale + i128::from(scaled % self.scale != 0)) as Ticks
    }

    /// Sets the fixed delay to zero and keeps jitter and faults.
    #[cfg(test)]
    pub(super) fn clear_fixed_delay(&mut self) {
        self.base = 0;
    }

    /// The least and the largest delay that any sample can have, ticks.
    ///
    /// The least is the delay without faults: a fault that delays samples for a while neither closes nor opens an algebraic loop.
    pub fn delay_bounds(&self) -> (Ticks, Ticks) {
        // The largest sum of overlapping spans occurs where one of them begins.
        let most = self.faults.iter().map(|fault| self.extra_at_stamp(fault.from)).max();
        (
            self.delay_with(0, 0),
            self.delay_with(if self.spread == 0 { 0 } else { DRAW_RANGE - 1 }, most.unwrap_or(0)),
        )
    }

    /// True when any sample may be dropped.
    pub fn may_drop(&self) -> bool {
        self.drop_below > 0 || self.faults.iter().any(|fault| fault.drop_below > 0)
    }

    /// True when sample `k` never arrives.
    pub fn is_dropped(&self, k: u64) -> bool {
        let lost = self.drop_below > 0 && (self.random.bits(2 * k + 1) >> 32) < self.drop_below;
        lost || (!self.faults.is_empty() && self.is_dropped_by_fault(k))
    }

    fn is_dropped_by_fault(&self, k: u64) -> bool {
        let stamp = self.producer.instant(k);
        let lost =
            |fault: &ScheduledLinkFault| fault.applies_to(stamp) && (fault.random.bits(k) >> 32) < fault.drop_below;
        self.faults.iter().any(lost)
    }

    /// The value of an input in place of a dropped sample.
    pub fn hold(&self) -> Hold {
        self.hold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_weight_is_independent_of_tick() {
        let fraction = |denominator: i128| Rational::new(1, denominator).unwrap();
        let coarse = Timebase::from_times([fraction(300)]).unwrap();
        let fine = Timebase::from_times([fraction(300), fraction(700)]).unwrap();
        assert_eq!(fine.tick(), fraction(2100));
        for jitter in [Rational::ZERO, fraction(1100)] {
            let timing = Timing {
                delay: fraction(700),
                jitter,
                hold: Hold::Linear,
                ..Timing::default()
            };
            let rule = |timebase: &Timebase| {
                let producer = SampleTime {
                    offset: 0,
                    period: timebase.ceil(fraction(100)).unwrap(),
                };
                DeliveryRule::new(&timing, &[], producer, timebase, 1, "x").unwrap()
            };
            let (coarse, fine) = (rule(&coarse), rule(&fine));
            for t in 1..3000 {
                // The delay is 3 of the fine ticks, of which the coarse one has 7.
                let before = (7 * t - 3) / 21;
                for after in before + 1..before + 4 {
                    let nearest = (7 * t - 3 - 21 * before) as f64 / (21 * (after - before)) as f64;
                    let bits = |rule: &DeliveryRule, t| rule.weight(t, before as u64, after as u64).to_bits();
                    let weights = [bits(&coarse, t), bits(&fine, 7 * t)];
                    assert_eq!(
                        weights,
                        [nearest.to_bits(); 2],
                        "instant {t}, samples {before} and {after}"
                    );
                }
            }
        }
    }
}
