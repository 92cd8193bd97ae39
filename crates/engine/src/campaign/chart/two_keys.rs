//! The chart over two varied keys: a map.

use report::figures::{Drawing, Map, MapCell, Shade};

use super::content::{ChartContent, PlotPosition, axis_label, index_by_value};
use crate::campaign::Column;
use crate::campaign::figure_value;
use crate::campaign::summary::distinct;
use crate::campaign::workers::point::Result as PointResult;
use crate::text::three_digits;

/// Each position in the colour of the outcome of its points.
pub(crate) fn map_over_two_keys(chart: &ChartContent<'_>, x: &Column, y: &Column) -> Drawing {
    let (across, down) = (sorted_values(x), sorted_values(y));
    let mut positions = vec![PlotPosition::default(); across.len() * down.len()];
    let (columns, rows) = (index_by_value(&across), index_by_value(&down));
    for (at, result) in chart.results.iter().enumerate() {
        let position = rows[&y.texts[at]] * across.len() + columns[&x.texts[at]];
        positions[position].results.push(result.as_ref());
    }
    let of = |result: &PointResult| figure_value(result, &chart.figure?.key);
    let lower_is_worse = chart.lower_is_worse();
    let worst: Vec<Option<f64>> = positions.iter().map(|cell| cell.worst(lower_is_worse, of)).collect();
    let good = |at: &usize| matches!(positions[*at].shade(), Shade::Good(_));
    let values: Vec<f64> = (0..positions.len())
        .filter(good)
        .filter_map(|at| worst[at])
        .filter(|v| *v > 0.0)
        .collect();
    let (low, high) = (
        values.iter().copied().fold(f64::INFINITY, f64::min),
        values.iter().copied().fold(0.0, f64::max),
    );
    let part = |value: f64| {
        if high > low && value > 0.0 {
            ((value / low).ln() / (high / low).ln()) as f32
        } else {
            0.0
        }
    };
    let folded = positions.iter().any(|position| position.results.len() > 1);
    let cells = positions.iter().zip(&worst).map(|(position, worst)| MapCell {
        shade: match position.shade() {
            Shade::Good(_) => Shade::Good(worst.map_or(0.0, part)),
            other => other,
        },
        text: match (position.shade(), worst) {
            (Shade::Unknown, _) => String::new(),
            (Shade::Broken, _) => "!".to_owned(),
            _ if folded => {
                let good = position.results.iter().flatten().filter(|result| result.outcome.good());
                format!("{}/{}", good.count(), position.results.len())
            }
            (_, Some(worst)) => three_digits(*worst),
            (_, None) => String::new(),
        },
    });
    Map {
        title: chart.title.to_owned(),
        x_label: axis_label(x),
        y_label: axis_label(y),
        columns: across.iter().map(|value| without_unit(x, value)).collect(),
        rows: down.iter().map(|value| without_unit(y, value)).collect(),
        cells: cells.collect(),
        legend: legend(chart, &positions, (!values.is_empty()).then_some([low, high]), folded),
    }
    .drawing()
}

/// What the colours and the texts of cells mean; `range` has the lowest and highest value of good cells, `folded` says that a cell
/// has several points.
fn legend(
    chart: &ChartContent<'_>,
    positions: &[PlotPosition<'_>],
    range: Option<[f64; 2]>,
    folded: bool,
) -> Vec<(Option<Shade>, String)> {
    let (mut legend, word) = (Vec::new(), chart.success_name());
    let shown = chart.figure.map(|figure| (figure.display_name(), figure.unit.as_str()));
    match (&shown, range) {
        (Some((name, unit)), Some(range)) => {
            let text = |value: f64| format!("{word}, {name} {} {unit}", three_digits(value));
            legend.extend([0.0, 1.0].map(Shade::Good).map(Some).into_iter().zip(range.map(text)));
        }
        _ => legend.push((Some(Shade::Good(0.0)), word.to_owned())),
    }
    if positions.iter().any(|position| position.shade() == Shade::Bad) {
        legend.push((Some(Shade::Bad), "ran, not met".to_owned()));
    }
    if positions.iter().any(|position| position.shade() == Shade::Broken) {
        legend.push((Some(Shade::Broken), "did not run to its end".to_owned()));
    }
    match &shown {
        _ if folded => legend.push((None, format!("numbers: how many of the points of a place are {word}"))),
        Some((name, unit)) => legend.push((
            None,
            format!("numbers: {name} [{}]", if unit.is_empty() { "1" } else { unit }),
        )),
        None => {}
    }
    legend
}

/// The values of a column: numbers by size, texts in order of occurrence.
fn sorted_values(column: &Column) -> Vec<&String> {
    let mut values: Vec<(usize, &String)> = distinct(&column.texts)
        .into_iter()
        .map(|value| (column.texts.iter().position(|text| text == value).unwrap_or(0), value))
        .collect();
    if let Some(numbers) = &column.numbers {
        values.sort_by(|a, b| f64::total_cmp(&numbers[a.0], &numbers[b.0]));
    }
    values.into_iter().map(|(_, value)| value).collect()
}

/// The value without its unit, which the axis shows.
fn without_unit(column: &Column, value: &str) -> String {
    if column.unit.is_empty() {
        value.to_owned()
    } else {
        value.strip_suffix(&column.unit).unwrap_or(value).trim().to_owned()
    }
}
