//! Statistics of one figure over all points.

use report::campaign::floats;
use sampling::statistics::{correlation, indices, moments, percentile, ranks};
use serde_json::{Value, json};

use crate::campaign::wilson;
use crate::campaign::workers::point::Result as PointResult;
use crate::campaign::{Column, Figures, Number, figure_value};

/// Confidence level of all intervals.
pub(super) const CONFIDENCE: f64 = 0.95;

/// The fractions of a sample whose percentiles are reported.
const PERCENTILE_FRACTIONS: [f64; 6] = [0.01, 0.05, 0.5, 0.9, 0.95, 0.99];

/// The values of a figure.
pub(super) struct FigureSample {
    pub(super) name: String,
    pub(super) unit: String,
    /// Whether the figure is the truth value of the criteria: 0 or 1.
    pub(super) truth: bool,
    /// The limits of its criterion, in its unit.
    pub(super) limits: Vec<f64>,
    /// Whether small values are the bad ones.
    pub(super) lower_is_worse: bool,
    /// The value of each point.
    pub(super) values: Vec<Option<f64>>,
}

/// A column of numbers with its ranks.
pub(super) struct RankedColumn<'a> {
    numbers: &'a [f64],
    ranks: Vec<f64>,
}

impl RankedColumn<'_> {
    pub(super) fn of(column: &Column) -> Option<RankedColumn<'_>> {
        column.numbers.as_ref().map(|numbers| RankedColumn {
            numbers,
            ranks: ranks(numbers),
        })
    }
}

/// The truth values of the criteria for points that ran, where they differ between points, and every figure.
pub(super) fn samples(results: &[Option<PointResult>]) -> Vec<FigureSample> {
    let mut all = Vec::new();
    let good: Vec<Option<f64>> = results
        .iter()
        .map(|result| result.as_ref().filter(|result| result.outcome.ran()))
        .map(|ran| ran.map(|result| f64::from(u8::from(result.outcome.good()))))
        .collect();
    let differs = good.iter().flatten().any(|one| *one == 0.0) && good.iter().flatten().any(|one| *one == 1.0);
    if differs {
        all.push(FigureSample {
            name: crate::campaign::success_name(results).to_owned(),
            unit: String::new(),
            truth: true,
            limits: Vec::new(),
            lower_is_worse: true,
            values: good,
        });
    }
    let all_figures = || results.iter().flatten().filter_map(PointResult::final_figures);
    for number in all_figures().next().map_or(Vec::new(), Figures::ordered) {
        let values = results
            .iter()
            .map(|result| figure_value(result.as_ref()?, &number.key).filter(|value| value.is_finite()));
        let (limits, lower_is_worse) = limits(&number, all_figures());
        all.push(FigureSample {
            name: number.display_name(),
            unit: number.unit,
            truth: false,
            limits,
            lower_is_worse,
            values: values.collect(),
        });
    }
    all
}

/// The limits of the criterion of that name, converted to the unit of the figure, which may differ from that of the
/// criterion.
fn limits<'a>(number: &Number, all: impl Iterator<Item = &'a Figures>) -> (Vec<f64>, bool) {
    for figures in all {
        let Some(criterion) = figures.criteria.iter().find(|criterion| criterion.name == number.name) else {
            return (Vec::new(), false);
        };
        let lower_is_worse = criterion.limit.is_none() && criterion.at_least.is_some();
        if let Some(limits) = figures.limits_of(number, criterion) {
            return (limits, lower_is_worse);
        }
    }
    (Vec::new(), false)
}

impl FigureSample {
    /// The values that are present.
    pub(super) fn present_values(&self) -> Vec<f64> {
        self.values.iter().flatten().copied().collect()
    }

    /// The data that a page draws of it at the points `shown`.
    pub(super) fn plot_data(&self, shown: impl Iterator<Item = usize>) -> Value {
        let values = shown.map(|at| self.values[at].unwrap_or(f64::NAN));
        json!({
            "name": self.name,
            "unit": self.unit,
            "truth": self.truth,
            "limits": self.limits,
            "lowest": self.lower_is_worse,
            "values": floats(values.collect()),
        })
    }

    pub(super) fn moments(&self) -> Option<[f64; 2]> {
        moments(&self.present_values()).map(|(mean, deviation)| [mean, deviation])
    }

    /// A row for each percentile: the fraction, the percentile, and with `intervals` the ends of its interval.
    pub(super) fn percentiles(&self, intervals: bool) -> Value {
        let mut sorted = self.present_values();
        sorted.sort_by(f64::total_cmp);
        let rows = PERCENTILE_FRACTIONS.iter().filter_map(|part| {
            let own = percentile(&sorted, *part, CONFIDENCE)?;
            Some(json!([
                part,
                own.value,
                own.low.filter(|_| intervals),
                own.high.filter(|_| intervals)
            ]))
        });
        rows.collect()
    }

    /// The rank correlation with each input; inputs that are texts have none.
    pub(super) fn correlations(&self, inputs: &[Option<RankedColumn<'_>>]) -> Vec<Option<f64>> {
        let whole = self.values.iter().all(Option::is_some);
        let own = ranks(&self.present_values());
        let with = |input: &RankedColumn<'_>| {
            if whole {
                return correlation(&input.ranks, &own);
            }
            let both = self.values.iter().zip(input.numbers);
            let input_values: Vec<f64> = both.filter(|(value, _)| value.is_some()).map(|(_, x)| *x).collect();
            correlation(&ranks(&input_values), &own)
        };
        inputs.iter().map(|input| input.as_ref().and_then(with)).collect()
    }

    /// Estimates over a growing number of points: the number; the share of a truth value, else median and 95 %; each with
    /// its interval, if `intervals`.
    pub(super) fn convergence(&self, intervals: bool) -> Value {
        let all = self.present_values();
        let mut sizes = Vec::new();
        let mut size = 10_usize;
        while size < all.len() {
            sizes.push(size);
            size += (size / 3).max(1);
        }
        sizes.push(all.len());
        let mut rows = Vec::new();
        for size in sizes.into_iter().filter(|size| *size > 0) {
            let mut part = all[..size].to_vec();
            if self.truth {
                let good = part.iter().filter(|one| **one > 0.5).count();
                let (low, high) = intervals.then(|| wilson(good, size)).unzip();
                rows.push(json!([size, good as f64 / size as f64, low, high]));
                continue;
            }
            part.sort_by(f64::total_cmp);
            let [median, most] = [0.5, 0.95].map(|at| percentile(&part, at, CONFIDENCE));
            if let (Some(median), Some(most)) = (median, most) {
                rows.push(json!([
                    size,
                    median.value,
                    median.low.filter(|_| intervals),
                    median.high.filter(|_| intervals),
                    most.value,
                    most.low.filter(|_| intervals),
                    most.high.filter(|_| intervals)
                ]));
            }
        }
        rows.into()
    }

    /// First-order and total indices with their half-widths, from the rows that ran completely. `width` points make a row.
    pub(super) fn indices(&self, width: usize) -> Option<Value> {
        if width == 0 {
            return None;
        }
        let rows = self.values.chunks_exact(width);
        let whole: Vec<Vec<f64>> = rows.filter_map(|row| row.iter().copied().collect()).collect();
        let all = indices(&whole)?;
        let rows = all
            .iter()
            .map(|one| json!([one.first, one.first_half_width, one.total, one.total_half_width]));
        Some(json!({ "rows": whole.len(), "of": rows.collect::<Vec<_>>() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::Criterion;
    use crate::campaign::Outcome;

    fn point(outcome: Outcome, value: f64, unit: &str, limit: f64) -> Option<PointResult> {
        let number = Number {
            key: "miss".into(),
            name: "miss".into(),
            unit: unit.into(),
            value: Some(value),
        };
        let criterion = Criterion {
            name: "miss".into(),
            unit: "m".into(),
            value: Some(if unit == "mm" { value / 1000.0 } else { value }),
            limit: Some(limit),
            ..Criterion::default()
        };
        Some(PointResult {
            figures: Some(Figures::new(vec![number], vec![criterion])),
            ..PointResult::without(outcome, "")
        })
    }

    /// What a run that fails has measured until then is no figure of the run.
    #[test]
    fn samples_have_no_figures_of_runs_that_ended_early() {
        let results = [
            point(Outcome::Failed, 50.0, "m", 6.0),
            point(Outcome::Met, 1.0, "m", 6.0),
            point(Outcome::Crashed, -50.0, "m", 6.0),
            None,
            point(Outcome::NotMet, 7.0, "m", 6.0),
        ];
        let samples = samples(&results);
        let miss = samples.iter().find(|sample| sample.name == "miss").unwrap();
        assert_eq!(miss.values, [None, Some(1.0), None, None, Some(7.0)]);
        assert_eq!(figure_value(results[0].as_ref().unwrap(), "miss"), None);
        // The same where the first point with figures failed and no other has any.
        assert!(super::samples(&results[..1]).is_empty());
    }

    #[test]
    fn limits_are_those_of_the_scenario_to_every_digit() {
        for at in 1..2000 {
            let value = 0.1 * f64::from(at) + 0.003;
            for (unit, limit, expected) in [("m", 6.0, 6.0), ("mm", 0.006, 6.0)] {
                let samples = samples(&[point(Outcome::Met, value, unit, limit)]);
                assert_eq!(samples[0].limits, [expected], "{value} {unit}");
            }
        }
    }
}
