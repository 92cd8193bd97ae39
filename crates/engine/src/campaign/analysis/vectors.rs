//! Figures that are vectors: median distances from zero and from the mean.

use report::campaign::floats;
use sampling::statistics::percentile;
use serde_json::{Value, json};

use super::figure::{CONFIDENCE, FigureSample};

/// Each vector of two or three numbers with its circular (or spherical) error probable: the median distance.
pub(super) fn vector_figures(samples: &[FigureSample], shown: &[usize]) -> Vec<Value> {
    let mut all = Vec::new();
    for (at, first) in samples.iter().enumerate() {
        let Some(stem) = first.name.strip_suffix("[0]") else {
            continue;
        };
        let own = |number: usize| {
            samples
                .get(at + number)
                .filter(|one| one.name == format!("{stem}[{number}]"))
        };
        let elements: Vec<&FigureSample> = (0..4).map_while(own).collect();
        if !(2..=3).contains(&elements.len()) {
            continue;
        }
        let row = |point: usize| -> Option<Vec<f64>> { elements.iter().map(|one| one.values[point]).collect() };
        let rows: Vec<Vec<f64>> = (0..first.values.len()).filter_map(row).collect();
        if rows.is_empty() {
            continue;
        }
        let mean: Vec<f64> = (0..elements.len())
            .map(|element| rows.iter().map(|row| row[element]).sum::<f64>() / rows.len() as f64)
            .collect();
        let from = |centre: &[f64]| -> Value {
            let distance = |row: &Vec<f64>| {
                let squares = row.iter().zip(centre).map(|(x, c)| (x - c) * (x - c));
                libm::sqrt(squares.sum())
            };
            let mut distances: Vec<f64> = rows.iter().map(distance).collect();
            distances.sort_by(f64::total_cmp);
            let of = |part| percentile(&distances, part, CONFIDENCE).map(|own| json!([own.value, own.low, own.high]));
            json!([of(0.5), of(0.95)])
        };
        let values = elements.iter().map(|one| {
            let values = shown.iter().map(|at| one.values[*at].unwrap_or(f64::NAN));
            floats(values.collect())
        });
        all.push(json!({
            "name": stem,
            "unit": first.unit,
            "size": elements.len(),
            "values": values.collect::<Vec<_>>(),
            "zero": from(&vec![0.0; elements.len()]),
            "centre": mean,
            "mean": from(&mean),
        }));
    }
    all
}
