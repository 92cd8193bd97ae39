//! Contents of a campaign's chart, and the combined result of the points at one of its positions.

use std::collections::BTreeMap;

use report::figures::{Curve, Shade};

use crate::campaign::Column;
use crate::campaign::figures::{Figures, Number};
use crate::campaign::summary::success_name;
use crate::campaign::workers::point::{Outcome, Result as PointResult};

/// What to draw.
#[derive(Debug)]
pub struct ChartContent<'a> {
    /// The scenario's title.
    pub title: &'a str,
    /// The labels of the points.
    pub columns: &'a [Column],
    /// The results of the points.
    pub results: &'a [Option<PointResult>],
    /// The figure of merit that is shown; the criteria unless given.
    pub figure: Option<&'a Number>,
}

impl<'a> ChartContent<'a> {
    /// The figures of the first point that ran and has any.
    pub(crate) fn first_figures(&self) -> Option<&'a Figures> {
        self.results.iter().flatten().find_map(PointResult::final_figures)
    }

    /// The name of the outcome of a successful point.
    pub(crate) fn success_name(&self) -> &'static str {
        success_name(self.results)
    }

    /// Whether the figure shown has a lower limit and no upper one.
    pub(crate) fn lower_is_worse(&self) -> bool {
        let criteria = self.first_figures().map_or(&[][..], |figures| &figures.criteria);
        let own = criteria
            .iter()
            .find(|one| self.figure.is_some_and(|figure| figure.name == one.name));
        own.is_some_and(|criterion| criterion.limit.is_none())
    }
}

/// Points that share a position of the chart.
#[derive(Debug, Default, Clone)]
pub(crate) struct PlotPosition<'a> {
    pub(crate) results: Vec<Option<&'a PointResult>>,
}

impl PlotPosition<'_> {
    pub(crate) fn shade(&self) -> Shade {
        let known: Vec<&&PointResult> = self.results.iter().flatten().collect();
        if known.len() < self.results.len() {
            Shade::Unknown
        } else if known.iter().any(|result| !result.outcome.ran()) {
            Shade::Broken
        } else if known.iter().any(|result| result.outcome == Outcome::NotMet) {
            Shade::Bad
        } else {
            Shade::Good(0.0)
        }
    }

    /// The worst value of a figure: the greatest, or the least where it has a lower limit only.
    pub(crate) fn worst(&self, lower_is_worse: bool, of: impl Fn(&PointResult) -> Option<f64>) -> Option<f64> {
        let values = self.results.iter().flatten().filter_map(|result| of(result));
        let worse = if lower_is_worse { f64::min } else { f64::max };
        values.filter(|value| value.is_finite()).reduce(worse)
    }
}

/// Whether the values above zero of all curves span more than a linear axis shows.
pub(crate) fn needs_logarithm(curves: &[Curve]) -> bool {
    let values = || {
        let points = curves.iter().flat_map(|curve| &curve.points);
        points.map(|point| point[1]).filter(|y| *y > 0.0)
    };
    values().fold(0.0, f64::max) / values().fold(f64::INFINITY, f64::min) > 30.0
}

/// The name of a column as an axis label.
pub(crate) fn axis_label(column: &Column) -> String {
    if column.unit.is_empty() {
        column.name.clone()
    } else {
        format!("{} [{}]", column.name, column.unit)
    }
}

/// The number of each value.
pub(crate) fn index_by_value<'a>(values: &[&'a String]) -> BTreeMap<&'a String, usize> {
    values
        .iter()
        .enumerate()
        .map(|(number, value)| (*value, number))
        .collect()
}
