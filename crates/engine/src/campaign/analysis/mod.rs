//! Statistics of a campaign: all contents of its page.

mod cases;
mod failures;
mod figure;
mod vectors;

pub use cases::of_cases;
use report::campaign::floats;
use serde_json::{Value, json};

use super::column::INDEX_COLUMNS;
use super::figures::LimitUsage;
use super::success_name;
use super::verdicts;
use super::wilson;
use super::workers::point::{Result as PointResult, outcome_name};
use super::{Campaign, Column, RareEventResult};
use figure::FigureSample;

/// Pictures are thinned out to this number of points; the numbers use all points.
const SHOWN_MAX: usize = 5000;

/// The statistics of a campaign, for its page.
pub fn analysis(title: &str, campaign: &Campaign, results: &[Option<PointResult>]) -> Value {
    let inputs: Vec<&Column> = campaign.columns.iter().filter(|column| is_input(column)).collect();
    let ranked: Vec<Option<figure::RankedColumn<'_>>> =
        inputs.iter().map(|column| figure::RankedColumn::of(column)).collect();
    let samples = figure::samples(results);
    let factors = campaign.source.as_ref().and_then(|source| source.factors.as_ref());
    let width = factors.map_or(0, |factors| factors.len() + 2);
    let every = results.len().div_ceil(SHOWN_MAX).max(1);
    let shown: Vec<usize> = (0..results.len()).step_by(every).collect();
    let sample = campaign.is_sample();
    let measures = samples.iter().map(|figure| figure.json(&ranked, width, &shown, sample));
    let ran = results.iter().flatten().filter(|result| result.outcome.ran()).count();
    let good = results.iter().flatten().filter(|result| result.outcome.good()).count();
    // On a grid the same draws are used in each cell: the points are not independent, and no interval of a sample holds.
    let interval = sample.then(|| wilson(good, ran));
    json!({
        "title": title,
        "words": verdicts(results),
        "good": success_name(results),
        "points": results.len(),
        "shown": shown.iter().map(|at| at + 1).collect::<Vec<_>>(),
        "share": { "good": good, "ran": ran, "interval": interval },
        "outcomes": shown.iter().map(|at| outcome_name(results[*at].as_ref())).collect::<Vec<_>>(),
        "columns": campaign.columns.iter().map(|column| [column.name.as_str(), column.unit.as_str()]).collect::<Vec<_>>(),
        "inputs": inputs.iter().map(|column| input_data(column, &shown)).collect::<Vec<_>>(),
        "measures": measures.collect::<Vec<_>>(),
        "factors": factors,
        "vectors": vectors::vector_figures(&samples, &shown),
        "failures": failures::failure_groups(results),
        "worst": worst(campaign, results),
    })
}

impl RareEventResult {
    /// The statistics for the page of a rare-event campaign: those of the first level, which is a plain random sample, with
    /// the estimate of the event and the worst of all points.
    pub fn analysis(&self, title: &str) -> Value {
        let results = &self.finished.results;
        let sample = self.sample.min(results.len());
        let mut all = analysis(title, &self.campaign.first(sample), &results[..sample]);
        all["rare"] = self.json();
        all["worst"] = worst(&self.campaign, results);
        all
    }
}

/// Whether figures may depend on a column: it does not number the points, and is not constant.
fn is_input(column: &Column) -> bool {
    let differs = column.texts.iter().any(|text| *text != column.texts[0]);
    differs && !INDEX_COLUMNS.contains(&column.name.as_str())
}

/// A column as the page draws it: numbers, or indices of its texts.
fn input_data(column: &Column, shown: &[usize]) -> Value {
    let mut words: Vec<&String> = Vec::new();
    let numbers: Vec<f64> = match &column.numbers {
        Some(numbers) => shown.iter().map(|at| numbers[*at]).collect(),
        None => {
            words = super::summary::distinct(&column.texts);
            let place = |at: &usize| words.iter().position(|word| **word == column.texts[*at]);
            shown
                .iter()
                .map(|at| place(at).map_or(f64::NAN, |at| at as f64))
                .collect()
        }
    };
    json!({
        "name": column.name,
        "unit": column.unit,
        "words": words,
        "values": floats(numbers),
    })
}

/// The ten points that are nearest to their limits, or furthest beyond, as fractions of the limits; with the values drawn
/// for each.
fn worst(campaign: &Campaign, results: &[Option<PointResult>]) -> Value {
    let mut all: Vec<(LimitUsage, &str, usize)> = Vec::new();
    for (at, result) in results.iter().enumerate() {
        let figures = result.as_ref().filter(|result| result.outcome.ran());
        let Some(figures) = figures.and_then(|result| result.figures.as_ref()) else {
            continue;
        };
        if let Some((usage, name)) = figures.most_critical() {
            all.push((usage, name, at));
        }
    }
    all.sort_by(|a, b| b.0.cmp_severity(&a.0).then(a.2.cmp(&b.2)));
    all.iter()
        .take(10)
        .map(|(usage, name, at)| {
            let drawn = campaign.columns.iter().map(|column| match &column.numbers {
                Some(numbers) => json!(numbers[*at]),
                None => json!(column.texts[*at]),
            });
            json!({
                "point": at + 1,
                "outcome": outcome_name(results[*at].as_ref()),
                "criterion": name.replace('_', " "),
                "part": usage.fraction(),
                "drawn": drawn.collect::<Vec<_>>(),
            })
        })
        .collect()
}

impl FigureSample {
    fn json(
        &self,
        inputs: &[Option<figure::RankedColumn<'_>>],
        width: usize,
        shown: &[usize],
        intervals: bool,
    ) -> Value {
        let mut all = self.plot_data(shown.iter().copied());
        all["count"] = json!(self.present_values().len());
        all["moments"] = json!(self.moments());
        all["percentiles"] = self.percentiles(intervals);
        all["correlations"] = json!(self.correlations(inputs));
        all["convergence"] = self.convergence(intervals);
        all["indices"] = json!(self.indices(width));
        all
    }
}
