//! Chart of drawn points: the distribution of their distances from the limits.

use report::figures::{Band, Chart, Curve, Drawing, Limit, Shade, Stroke};

use super::content::{ChartContent, needs_logarithm};
use crate::campaign::figure_value;
use crate::campaign::figures::{Figures, Number};
use crate::campaign::workers::point::Result as PointResult;
use crate::text::three_digits;

/// Maximum number of marks of a curve.
const MARKS_MAX: usize = 60;

/// For each criterion its sorted values, as fractions of the limit, over the fraction of the points; without criteria those
/// of the figure. The fraction of the points that is met is green. `None` where there is nothing to draw.
pub(crate) fn draw_distribution(chart: &ChartContent<'_>) -> Option<Drawing> {
    let with = || chart.results.iter().flatten().filter_map(PointResult::final_figures);
    let mut curves = limit_fraction_curves(with);
    let (mut limits, mut y_label) = (Vec::new(), "part of the limit".to_owned());
    if curves.is_empty() {
        let Number { key, unit, .. } = chart.figure?;
        let values = chart
            .results
            .iter()
            .flatten()
            .filter_map(|result| figure_value(result, key));
        curves.extend(curve(String::new(), values));
        y_label = format!(
            "{} [{}]",
            chart.figure?.display_name(),
            if unit.is_empty() { "1" } else { unit }
        );
    } else {
        limits.push(Limit {
            value: 1.0,
            name: "limit".into(),
        });
    }
    if curves.is_empty() {
        return None;
    }
    let ran = chart
        .results
        .iter()
        .flatten()
        .filter(|result| result.outcome.ran())
        .count();
    let good = chart
        .results
        .iter()
        .flatten()
        .filter(|result| result.outcome.good())
        .count();
    let share = 100.0 * good as f64 / ran.max(1) as f64;
    let title = format!("{}: {share:.1} % {}", chart.title, chart.success_name());
    let chart = Chart {
        title,
        x_label: "part of the points, by size [%]".to_owned(),
        y_label,
        x_names: Vec::new(),
        logarithmic_x: false,
        logarithmic: needs_logarithm(&curves),
        bands: vec![Band {
            from: 0.0,
            to: share,
            shade: Shade::Good(0.0),
        }],
        curves,
        limits,
    };
    Some(chart.drawing())
}

/// The values of each criterion that has an upper limit, as fractions of it.
fn limit_fraction_curves<'a, I: Iterator<Item = &'a Figures>>(with: impl Fn() -> I) -> Vec<Curve> {
    let criteria = with().next().map_or(&[][..], |figures| &figures.criteria);
    let mut curves = Vec::new();
    for criterion in criteria {
        let Some(limit) = criterion.limit.filter(|limit| *limit > 0.0) else {
            continue;
        };
        let parts = with().filter_map(|figures| {
            let own = figures.criteria.iter().find(|own| own.name == criterion.name)?;
            Some(own.value? / limit)
        });
        let name = criterion.name.replace('_', " ");
        curves.extend(curve(
            format!("{name} (limit {} {})", three_digits(limit), criterion.unit),
            parts,
        ));
    }
    curves
}

/// Sorted values over their cumulative share, %.
fn curve(name: String, values: impl Iterator<Item = f64>) -> Option<Curve> {
    let mut sorted: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let marks = sorted.len().min(MARKS_MAX);
    let points = (0..marks).map(|mark| {
        // The least and the greatest are included.
        let at = if marks > 1 { mark * last / (marks - 1) } else { last };
        [100.0 * (at + 1) as f64 / sorted.len() as f64, sorted[at]]
    });
    Some(Curve {
        name,
        points: points.collect(),
        stroke: Stroke::Marked,
    })
}
