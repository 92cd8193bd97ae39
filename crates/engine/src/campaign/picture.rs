//! The picture of a campaign: where the criteria are met.

use std::collections::BTreeMap;

use report::figures::{Band, Chart, Curve, Drawing, Limit, Map, MapCell, Shade};

use super::figures::Number;
use super::point::{Outcome, Result as PointResult};
use super::tell::{distinct, good_word};
use super::{Column, figure_value, short, spread};

/// What to draw.
#[derive(Debug)]
pub struct Picture<'a> {
    /// The scenario's title.
    pub title: &'a str,
    /// What tells the points apart.
    pub columns: &'a [Column],
    /// What became of them.
    pub results: &'a [Option<PointResult>],
    /// The figure of merit that is shown; the criteria unless given.
    pub figure: Option<&'a Number>,
}

impl Picture<'_> {
    /// What a point that went well is called.
    fn word(&self) -> &'static str {
        good_word(self.results)
    }

    /// Whether the figure that is shown has a least value and no greatest one.
    fn lowest(&self) -> bool {
        let figures = self.results.iter().flatten().find_map(|result| result.figures.as_ref());
        let criteria = figures.map_or(&[][..], |figures| &figures.criteria);
        let own = criteria
            .iter()
            .find(|one| self.figure.is_some_and(|figure| figure.name == one.name));
        own.is_some_and(|criterion| criterion.limit.is_none())
    }
}

/// Points that fall onto one place of the picture.
#[derive(Debug, Default, Clone)]
struct Place<'a> {
    results: Vec<Option<&'a PointResult>>,
}

impl Place<'_> {
    fn shade(&self) -> Shade {
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

    /// The worst value of a figure: the greatest, or the least where only that has a limit.
    fn worst(&self, lowest: bool, of: impl Fn(&PointResult) -> Option<f64>) -> Option<f64> {
        let values = self.results.iter().flatten().filter_map(|result| of(result));
        let worse = if lowest { f64::min } else { f64::max };
        values.filter(|value| value.is_finite()).reduce(worse)
    }
}

/// With more places along one of its sides a picture shows none of them.
const PLACES_MAX: usize = 2000;

/// The picture: a chart over one varied key, a map over two. What else is varied, and the seed beside another key, is folded:
/// a place is met when all of its points are, and shows the worst. Where hardly two points have a value in common, as those that were
/// drawn, and where a key has more than 2000 values, it is how far they stay from their limits. `None` when nothing is varied.
pub fn draw(picture: &Picture<'_>) -> Option<Drawing> {
    let varied: Vec<&Column> = picture
        .columns
        .iter()
        .filter(|column| distinct(&column.texts).len() > 1)
        .collect();
    let own = |column: &&&Column| column.name != "seed";
    let mut shown: Vec<&Column> = varied.iter().filter(own).take(2).copied().collect();
    if shown.is_empty() {
        shown.extend(varied.first());
    }
    let places: Vec<usize> = shown.iter().map(|column| distinct(&column.texts).len()).collect();
    // Values that were drawn lie nowhere twice, and make no map.
    let apart = places.len() == 2 && places[0] * places[1] > 4 * picture.results.len();
    match shown[..] {
        [_, ..] if apart || places.iter().any(|count| *count > PLACES_MAX) => spread::draw(picture),
        [x] => Some(chart(picture, x)),
        [x, y] => Some(over_two(picture, x, y)),
        _ => None,
    }
}

fn label(column: &Column) -> String {
    if column.unit.is_empty() {
        column.name.clone()
    } else {
        format!("{} [{}]", column.name, column.unit)
    }
}

/// The points of each value of `column`, in the order in which the values come first.
fn places<'a>(picture: &Picture<'a>, column: &'a Column) -> Vec<(&'a String, Place<'a>)> {
    let values = distinct(&column.texts);
    let mut places: Vec<(&String, Place<'_>)> = values.iter().map(|value| (*value, Place::default())).collect();
    let numbers = numbered(&values);
    for (text, result) in column.texts.iter().zip(picture.results) {
        places[numbers[text]].1.results.push(result.as_ref());
    }
    places
}

/// The number of each value.
fn numbered<'a>(values: &[&'a String]) -> BTreeMap<&'a String, usize> {
    values
        .iter()
        .enumerate()
        .map(|(number, value)| (*value, number))
        .collect()
}

fn chart(picture: &Picture<'_>, column: &Column) -> Drawing {
    let mut places = places(picture, column);
    let position = |value: &String| {
        let at = column.texts.iter().position(|text| text == value)?;
        column.numbers.as_ref().map(|numbers| numbers[at])
    };
    let numeric = column.numbers.is_some();
    if numeric {
        places.sort_by(|a, b| f64::total_cmp(&position(a.0).unwrap_or(0.0), &position(b.0).unwrap_or(0.0)));
    }
    let xs: Vec<f64> = places
        .iter()
        .enumerate()
        .map(|(at, (value, _))| position(value).unwrap_or(at as f64))
        .collect();
    let middle = |at: usize, other: usize| (xs[at] + xs[other]) / 2.0;
    let bands = places.iter().enumerate().map(|(at, (_, place))| Band {
        from: if at == 0 { xs[0] } else { middle(at, at - 1) },
        to: if at + 1 == xs.len() { xs[at] } else { middle(at, at + 1) },
        shade: place.shade(),
    });
    let lowest = picture.lowest();
    let curve = |name: &str, of: &dyn Fn(&PointResult) -> Option<f64>| Curve {
        name: name.to_owned(),
        points: xs
            .iter()
            .zip(&places)
            .map(|(x, (_, place))| [*x, place.worst(lowest, of).unwrap_or(f64::NAN)])
            .collect(),
    };
    let first = picture
        .results
        .iter()
        .flatten()
        .find_map(|result| result.figures.as_ref());
    let criteria = first.map_or(&[][..], |figures| &figures.criteria);
    let (mut curves, mut limits, y_label);
    if let Some(figure) = picture.figure {
        y_label = if figure.unit.is_empty() {
            figure.words()
        } else {
            format!("{} [{}]", figure.words(), figure.unit)
        };
        curves = vec![curve("", &|result| figure_value(result, &figure.key))];
        // a criterion may count in other units than the figure
        limits = Vec::new();
        if let Some(criterion) = criteria.iter().find(|criterion| criterion.name == figure.name)
            && let (Some(value), Some(own)) = (criterion.value, first.and_then(|first| first.value(&figure.key)))
            && value != 0.0
        {
            limits.extend(
                criterion
                    .limit
                    .into_iter()
                    .chain(criterion.at_least)
                    .map(|limit| Limit {
                        value: limit * own / value,
                        name: format!("limit {} {}", short(limit), criterion.unit),
                    }),
            );
        }
    } else {
        y_label = "part of the limit".to_owned();
        limits = vec![Limit {
            value: 1.0,
            name: "limit".into(),
        }];
        curves = Vec::new();
        for criterion in criteria {
            let Some(limit) = criterion.limit.filter(|limit| *limit > 0.0) else {
                continue;
            };
            let name = criterion.name.replace('_', " ");
            let name = format!("{name} (limit {} {})", short(limit), criterion.unit);
            curves.push(curve(&name, &|result| {
                let judged = &result.figures.as_ref()?.criteria;
                let own = judged.iter().find(|own| own.name == criterion.name)?;
                Some(own.value? / own.limit?)
            }));
        }
    }
    let values = || {
        curves
            .iter()
            .flat_map(|curve| &curve.points)
            .map(|point| point[1])
            .filter(|y| *y > 0.0)
    };
    let spread = values().fold(0.0, f64::max) / values().fold(f64::INFINITY, f64::min);
    Chart {
        title: format!("{}: green where {}", picture.title, picture.word()),
        x_label: label(column),
        y_label,
        x_names: if numeric {
            Vec::new()
        } else {
            places.iter().map(|(value, _)| (*value).clone()).collect()
        },
        logarithmic: spread > 30.0,
        bands: bands.collect(),
        curves,
        limits,
    }
    .drawing()
}

fn over_two(picture: &Picture<'_>, x: &Column, y: &Column) -> Drawing {
    let (across, down) = (in_order(x), in_order(y));
    let mut places = vec![Place::default(); across.len() * down.len()];
    let (columns, rows) = (numbered(&across), numbered(&down));
    for (at, result) in picture.results.iter().enumerate() {
        let place = rows[&y.texts[at]] * across.len() + columns[&x.texts[at]];
        places[place].results.push(result.as_ref());
    }
    let of = |result: &PointResult| figure_value(result, &picture.figure?.key);
    let worst: Vec<Option<f64>> = places.iter().map(|place| place.worst(picture.lowest(), of)).collect();
    let good = |at: &usize| matches!(places[*at].shade(), Shade::Good(_));
    let values: Vec<f64> = (0..places.len())
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
    let folded = places.iter().any(|place| place.results.len() > 1);
    let cells = places.iter().zip(&worst).map(|(place, worst)| MapCell {
        shade: match place.shade() {
            Shade::Good(_) => Shade::Good(worst.map_or(0.0, part)),
            other => other,
        },
        text: match (place.shade(), worst) {
            (Shade::Unknown, _) => String::new(),
            (Shade::Broken, _) => "!".to_owned(),
            _ if folded => {
                let good = place.results.iter().flatten().filter(|result| result.outcome.good());
                format!("{}/{}", good.count(), place.results.len())
            }
            (_, Some(worst)) => short(*worst),
            (_, None) => String::new(),
        },
    });
    let (mut legend, word) = (Vec::new(), picture.word());
    let shown = picture.figure.map(|figure| (figure.words(), figure.unit.as_str()));
    match &shown {
        Some((name, unit)) if !values.is_empty() => {
            legend.push((Some(Shade::Good(0.0)), format!("{word}, {name} {} {unit}", short(low))));
            legend.push((Some(Shade::Good(1.0)), format!("{word}, {name} {} {unit}", short(high))));
        }
        _ => legend.push((Some(Shade::Good(0.0)), word.to_owned())),
    }
    if places.iter().any(|place| place.shade() == Shade::Bad) {
        legend.push((Some(Shade::Bad), "ran, not met".to_owned()));
    }
    if places.iter().any(|place| place.shade() == Shade::Broken) {
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
    Map {
        title: picture.title.to_owned(),
        x_label: label(x),
        y_label: label(y),
        columns: across.iter().map(|value| bare(x, value)).collect(),
        rows: down.iter().map(|value| bare(y, value)).collect(),
        cells: cells.collect(),
        legend,
    }
    .drawing()
}

/// The values of a column: numbers by size, texts as they come.
fn in_order(column: &Column) -> Vec<&String> {
    let mut values: Vec<(usize, &String)> = distinct(&column.texts)
        .into_iter()
        .map(|value| (column.texts.iter().position(|text| text == value).unwrap_or(0), value))
        .collect();
    if let Some(numbers) = &column.numbers {
        values.sort_by(|a, b| f64::total_cmp(&numbers[a.0], &numbers[b.0]));
    }
    values.into_iter().map(|(_, value)| value).collect()
}

/// The value without its unit, which the axis has.
fn bare(column: &Column, value: &str) -> String {
    if column.unit.is_empty() {
        value.to_owned()
    } else {
        value.strip_suffix(&column.unit).unwrap_or(value).trim().to_owned()
    }
}
