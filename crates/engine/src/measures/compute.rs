//! Computation of a figure from a signal, sample by sample.

use serde::{Deserialize, Serialize};

use super::compensated_sum::CompensatedSum;

/// The computation. Thresholds and bands are in the unit of the signal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Compute {
    /// The least value.
    Min,
    /// The greatest value.
    Max,
    /// The greatest absolute value.
    MaxAbs,
    /// The mean of the samples.
    Mean,
    /// The root of the mean of the squares.
    Rms,
    /// The last value.
    Final,
    /// The value at an instant: the newest sample at that time.
    At,
    /// The greatest value less the least.
    Range,
    /// The integral over time by the trapezoidal rule.
    Integral,
    /// The integral of the absolute value.
    IntegralAbs,
    /// The largest change from one sample to the next, per second.
    Rate,
    /// The time during which the value is above this, s.
    TimeAbove(f64),
    /// The time during which the value is below this, s.
    TimeBelow(f64),
    /// The first instant at which the value reaches this from the side on which it started, s.
    FirstCrossing(f64),
    /// The settling time after which the value stays between these two, both included, s.
    SettlingTime(f64, f64),
    /// The number of times the value differs from that of the sample before.
    Changes,
    /// The least value that at least this percentage of the samples does not exceed.
    Percentile(f64),
}

/// A figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Its value, in the unit of the figure.
    pub value: f64,
    /// The instant, s, at which it was reached, where it is the value of an instant.
    pub t_s: Option<f64>,
}

/// Why there is no figure.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Absent {
    /// No sample lies in the window.
    #[error("there is no sample in the window")]
    Empty,
    /// There is only one sample; two are needed.
    #[error("there is one sample in the window, at t = {t_s} s, and two are needed")]
    Single {
        /// Its instant.
        t_s: f64,
    },
    /// A value that is infinite or not a number.
    #[error("the value is {value} at t = {t_s} s")]
    NotFinite {
        /// Its first instant.
        t_s: f64,
        /// The value.
        value: f64,
    },
    /// The figure exceeds the range of a double.
    #[error("the figure is larger than a double holds")]
    Overflow,
    /// The threshold is not reached.
    #[error("the value does not reach the threshold")]
    NeverThere,
    /// The band is left at the end, or never entered.
    #[error("the value is {value}, outside the band, at the end of the window, t = {t_s} s")]
    NotSettled {
        /// The last instant outside.
        t_s: f64,
        /// The value at that instant.
        value: f64,
    },
}

/// A sample of a signal.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Sample {
    t_s: f64,
    x: f64,
}

/// A figure in progress. A percentile keeps every value, 8 bytes each; every other computation uses constant memory.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Accumulator {
    compute: Compute,
    /// The distance of two samples, s.
    period: f64,
    count: u64,
    first: Option<Sample>,
    last: Option<Sample>,
    /// The extreme so far; the least and the greatest where both are needed.
    least: Option<Sample>,
    greatest: Option<Sample>,
    total: CompensatedSum,
    /// The number of samples, or changes, counted.
    counted: u64,
    /// When the threshold was reached, or the band entered for the last time.
    since: Option<f64>,
    non_finite: Option<Sample>,
    values: Vec<f64>,
}

impl Accumulator {
    pub(super) fn new(compute: Compute, period: f64) -> Accumulator {
        Accumulator {
            compute,
            period,
            count: 0,
            first: None,
            last: None,
            least: None,
            greatest: None,
            total: CompensatedSum::default(),
            counted: 0,
            since: None,
            non_finite: None,
            values: Vec::new(),
        }
    }

    /// Processes the next value of the window.
    pub(super) fn push(&mut self, t_s: f64, x: f64) {
        let sample = Sample { t_s, x };
        if !x.is_finite() {
            self.non_finite.get_or_insert(sample);
        }
        self.count += 1;
        let first = *self.first.get_or_insert(sample);
        let before = self.last.replace(sample);
        match self.compute {
            Compute::Min => self.update_least(sample),
            Compute::Max => self.update_greatest(sample),
            Compute::MaxAbs => self.update_greatest(Sample { t_s, x: x.abs() }),
            Compute::Range => {
                self.update_least(sample);
                self.update_greatest(sample);
            }
            Compute::Mean => self.total.add(x),
            Compute::Rms => self.total.add(x * x),
            Compute::Integral => before.into_iter().for_each(|b| self.total.add(0.5 * (b.x + x))),
            Compute::IntegralAbs => {
                before
                    .into_iter()
                    .for_each(|b| self.total.add(0.5 * (b.x.abs() + x.abs())));
            }
            Compute::Rate => before.into_iter().for_each(|b| {
                let x = (x - b.x).abs() / self.period;
                self.update_greatest(Sample { t_s, x });
            }),
            Compute::TimeAbove(threshold) => self.count_if(x > threshold, t_s),
            Compute::TimeBelow(threshold) => self.count_if(x < threshold, t_s),
            Compute::FirstCrossing(threshold) => {
                let there = (first.x < threshold && x >= threshold)
                    || (first.x > threshold && x <= threshold)
                    || first.x == threshold;
                if there {
                    self.since.get_or_insert(t_s);
                }
            }
            Compute::SettlingTime(low, high) => {
                if (low..=high).contains(&x) {
                    self.since.get_or_insert(t_s);
                } else {
                    self.since = None;
                }
            }
            Compute::Changes => {
                if before.is_some_and(|b| b.x != x) {
                    self.counted += 1;
                }
            }
            Compute::Percentile(_) => self.values.push(x),
            Compute::Final | Compute::At => {}
        }
    }

    fn update_least(&mut self, sample: Sample) {
        if self.least.is_none_or(|least| sample.x < least.x) {
            self.least = Some(sample);
        }
    }

    fn update_greatest(&mut self, sample: Sample) {
        if self.greatest.is_none_or(|greatest| sample.x > greatest.x) {
            self.greatest = Some(sample);
        }
    }

    fn count_if(&mut self, counts: bool, t_s: f64) {
        if counts {
            self.counted += 1;
            self.since.get_or_insert(t_s);
        }
    }

    /// The figure of the values so far.
    pub(super) fn finish(&self) -> Result<Found, Absent> {
        if let Some(Sample { t_s, x: value }) = self.non_finite {
            return Err(Absent::NotFinite { t_s, value });
        }
        let (Some(first), Some(last)) = (self.first, self.last) else {
            return Err(Absent::Empty);
        };
        let of = |sample: Option<Sample>| {
            let Sample { t_s, x: value } = sample.ok_or(Absent::Single { t_s: last.t_s })?;
            Ok(Found { value, t_s: Some(t_s) })
        };
        let whole = |value: f64| Found { value, t_s: None };
        let found = match self.compute {
            Compute::Min => of(self.least)?,
            Compute::Max | Compute::MaxAbs | Compute::Rate => of(self.greatest)?,
            Compute::Range => whole(of(self.greatest)?.value - of(self.least)?.value),
            Compute::Mean => whole(self.total.value() / self.count as f64),
            Compute::Rms => whole((self.total.value() / self.count as f64).sqrt()),
            Compute::Integral | Compute::IntegralAbs => whole(self.total.value() * self.period),
            Compute::Final | Compute::At => of(Some(last))?,
            Compute::TimeAbove(_) | Compute::TimeBelow(_) => Found {
                value: self.counted as f64 * self.period,
                t_s: self.since,
            },
            Compute::FirstCrossing(_) => {
                let t_s = self.since.ok_or(Absent::NeverThere)?;
                Found {
                    value: t_s,
                    t_s: Some(t_s),
                }
            }
            Compute::SettlingTime(..) => {
                let outside = Absent::NotSettled {
                    t_s: last.t_s,
                    value: last.x,
                };
                let since = self.since.ok_or(outside)?;
                Found {
                    value: since - first.t_s,
                    t_s: Some(since),
                }
            }
            Compute::Changes => whole(self.counted as f64),
            Compute::Percentile(percent) => whole(percentile(&self.values, percent)),
        };
        if found.value.is_finite() {
            Ok(found)
        } else {
            Err(Absent::Overflow)
        }
    }
}

/// The nearest-rank percentile: the least of `values`, which must not be empty, that at least `percent` of them do not
/// exceed.
fn percentile(values: &[f64], percent: f64) -> f64 {
    let mut sorted = values.to_vec();
    let rank = (percent * sorted.len() as f64 / 100.0).ceil() as usize;
    let at = rank.clamp(1, sorted.len()) - 1;
    *sorted.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(compute: Compute, values: &[f64]) -> Result<Found, Absent> {
        let mut accumulator = Accumulator::new(compute, 0.5);
        for (k, x) in values.iter().enumerate() {
            accumulator.push(k as f64 * 0.5, *x);
        }
        accumulator.finish()
    }

    fn found(value: f64, t_s: Option<f64>) -> Result<Found, Absent> {
        Ok(Found { value, t_s })
    }

    #[test]
    fn accumulator_matches_figures_computed_by_hand() {
        let x = [1.0, -4.0, 2.0, 2.0, 0.0];
        for (compute, value, t_s) in [
            (Compute::Min, -4.0, Some(0.5)),
            (Compute::Max, 2.0, Some(1.0)),
            (Compute::MaxAbs, 4.0, Some(0.5)),
            (Compute::Mean, 0.2, None),
            (Compute::Rms, 5.0_f64.sqrt(), None),
            (Compute::Final, 0.0, Some(2.0)),
            (Compute::Range, 6.0, None),
            (Compute::Integral, 0.25, None),
            (Compute::IntegralAbs, 4.25, None),
            (Compute::Rate, 12.0, Some(1.0)),
            (Compute::TimeAbove(1.0), 1.0, Some(1.0)),
            (Compute::TimeBelow(1.0), 1.0, Some(0.5)),
            (Compute::FirstCrossing(0.0), 0.5, Some(0.5)),
            (Compute::FirstCrossing(1.0), 0.0, Some(0.0)),
            (Compute::SettlingTime(0.0, 2.0), 1.0, Some(1.0)),
            (Compute::Changes, 3.0, None),
            (Compute::Percentile(50.0), 1.0, None),
            (Compute::Percentile(100.0), 2.0, None),
            (Compute::Percentile(0.0), -4.0, None),
        ] {
            assert_eq!(of(compute, &x), found(value, t_s), "{compute:?}");
        }
    }

    #[test]
    fn accumulator_reports_why_a_figure_is_absent() {
        assert_eq!(of(Compute::Mean, &[]), Err(Absent::Empty));
        assert_eq!(of(Compute::Rate, &[3.0]), Err(Absent::Single { t_s: 0.0 }));
        assert_eq!(of(Compute::FirstCrossing(9.0), &[1.0, 2.0]), Err(Absent::NeverThere));
        let outside = Absent::NotSettled { t_s: 0.5, value: 5.0 };
        assert_eq!(of(Compute::SettlingTime(0.0, 1.0), &[0.5, 5.0]), Err(outside));
        assert_eq!(
            of(Compute::Integral, &[f64::MAX, f64::MAX, f64::MAX]),
            Err(Absent::Overflow)
        );
        for compute in [
            Compute::Max,
            Compute::Changes,
            Compute::Percentile(5.0),
            Compute::TimeAbove(0.0),
        ] {
            let absent = of(compute, &[1.0, f64::NAN, 2.0]).expect_err("a figure of NaN");
            assert!(matches!(absent, Absent::NotFinite { t_s: 0.5, .. }), "{absent}");
        }
    }
}
