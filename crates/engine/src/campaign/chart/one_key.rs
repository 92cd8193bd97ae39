//! The chart over one varied key: curves.

use report::figures::{Band, Chart, Curve, Drawing, Limit, Stroke};

use super::content::{ChartContent, PlotPosition, axis_label, index_by_value, needs_logarithm};
use crate::campaign::Column;
use crate::campaign::figure_value;
use crate::campaign::summary::distinct;
use crate::campaign::workers::point::Result as PointResult;
use crate::text::three_digits;

/// The positions of a chart along its only axis.
struct KeyAxis<'a> {
    positions: Vec<(&'a String, PlotPosition<'a>)>,
    /// The coordinate of each position.
    xs: Vec<f64>,
    lower_is_worse: bool,
}

/// A figure of merit, or each criterion as a fraction of its limit.
pub(crate) fn chart_over_one_key(chart: &ChartContent<'_>, column: &Column) -> Drawing {
    let axis = KeyAxis::of(chart, column);
    let (y_label, curves, limits) = axis.figure(chart).unwrap_or_else(|| axis.criteria(chart));
    Chart {
        title: format!("{}: green where {}", chart.title, chart.success_name()),
        x_label: axis_label(column),
        y_label,
        x_names: if column.numbers.is_some() {
            Vec::new()
        } else {
            axis.positions.iter().map(|(value, _)| (*value).clone()).collect()
        },
        logarithmic_x: false,
        logarithmic: needs_logarithm(&curves),
        bands: axis.bands(),
        curves,
        limits,
    }
    .drawing()
}

/// The points of each value of `column`, in order of first occurrence of the values.
fn positions<'a>(chart: &ChartContent<'a>, column: &'a Column) -> Vec<(&'a String, PlotPosition<'a>)> {
    let values = distinct(&column.texts);
    let mut positions: Vec<(&String, PlotPosition<'_>)> =
        values.iter().map(|value| (*value, PlotPosition::default())).collect();
    let numbers = index_by_value(&values);
    for (text, result) in column.texts.iter().zip(chart.results) {
        positions[numbers[text]].1.results.push(result.as_ref());
    }
    positions
}

/// The label of the vertical axis, curves and limits.
type FigureCurves = (String, Vec<Curve>, Vec<Limit>);

impl<'a> KeyAxis<'a> {
    fn of(chart: &ChartContent<'a>, column: &'a Column) -> KeyAxis<'a> {
        let mut positions = positions(chart, column);
        let position = |value: &String| {
            let at = column.texts.iter().position(|text| text == value)?;
            column.numbers.as_ref().map(|numbers| numbers[at])
        };
        if column.numbers.is_some() {
            positions.sort_by(|a, b| f64::total_cmp(&position(a.0).unwrap_or(0.0), &position(b.0).unwrap_or(0.0)));
        }
        let xs = positions
            .iter()
            .enumerate()
            .map(|(at, (value, _))| position(value).unwrap_or(at as f64))
            .collect();
        KeyAxis {
            positions,
            xs,
            lower_is_worse: chart.lower_is_worse(),
        }
    }

    /// From the middle between two positions to the next one.
    fn bands(&self) -> Vec<Band> {
        let xs = &self.xs;
        let middle = |at: usize, other: usize| (xs[at] + xs[other]) / 2.0;
        let bands = self.positions.iter().enumerate().map(|(at, (_, position))| Band {
            from: if at == 0 { xs[0] } else { middle(at, at - 1) },
            to: if at + 1 == xs.len() { xs[at] } else { middle(at, at + 1) },
            shade: position.shade(),
        });
        bands.collect()
    }

    /// The worst value of each position.
    fn curve(&self, name: &str, of: &dyn Fn(&PointResult) -> Option<f64>) -> Curve {
        Curve {
            name: name.to_owned(),
            points: self
                .xs
                .iter()
                .zip(&self.positions)
                .map(|(x, (_, position))| [*x, position.worst(self.lower_is_worse, of).unwrap_or(f64::NAN)])
                .collect(),
            stroke: Stroke::Marked,
        }
    }

    /// The requested figure of merit, with its limits.
    fn figure(&self, chart: &ChartContent<'_>) -> Option<FigureCurves> {
        let figure = chart.figure?;
        let y_label = if figure.unit.is_empty() {
            figure.display_name()
        } else {
            format!("{} [{}]", figure.display_name(), figure.unit)
        };
        let curves = vec![self.curve("", &|result| figure_value(result, &figure.key))];
        // a criterion may have another unit than the figure
        let mut limits = Vec::new();
        let first = chart.first_figures();
        let criteria = first.map_or(&[][..], |figures| &figures.criteria);
        if let Some(criterion) = criteria.iter().find(|criterion| criterion.name == figure.name)
            && let Some(values) = first.and_then(|first| first.limits_of(figure, criterion))
        {
            let own = criterion.limit.into_iter().chain(criterion.at_least);
            limits.extend(values.into_iter().zip(own).map(|(value, limit)| Limit {
                value,
                name: format!("limit {} {}", three_digits(limit), criterion.unit),
            }));
        }
        Some((y_label, curves, limits))
    }

    /// Every criterion with an upper limit, as a fraction of it.
    fn criteria(&self, chart: &ChartContent<'_>) -> FigureCurves {
        let limits = vec![Limit {
            value: 1.0,
            name: "limit".into(),
        }];
        let mut curves = Vec::new();
        for criterion in chart.first_figures().map_or(&[][..], |figures| &figures.criteria) {
            let Some(limit) = criterion.limit.filter(|limit| *limit > 0.0) else {
                continue;
            };
            let name = criterion.name.replace('_', " ");
            let name = format!("{name} (limit {} {})", three_digits(limit), criterion.unit);
            curves.push(self.curve(&name, &|result| {
                let judged = &result.final_figures()?.criteria;
                let own = judged.iter().find(|own| own.name == criterion.name)?;
                Some(own.value? / own.limit?)
            }));
        }
        ("part of the limit".to_owned(), curves, limits)
    }
}
