//! The region that is searched: how large a feedback is beside its plant.
//!
//! Some infima lie at infinite gain. A search that only sees gamma follows them until rounding decides what it sees. So
//! growth has a price: a factor e in the feedback must lower gamma by a millionth, which no optimum at a finite gain
//! notices, and beyond [`LARGEST`] nothing is evaluated.

use super::problem::{Checked, Model};
use crate::linalg::{self, Matrix};

/// What a factor e in a large feedback must gain in ln γ.
pub(super) const PRICE: f64 = 1e-6;
/// Feedback beyond which nothing is evaluated, in multiples of the plant.
pub(super) const LARGEST: f64 = 1e10;

/// Units in which a gain matrix is as fast as its plant: K(i, j) is measured in `1/(rows[i] · columns[j])`.
#[derive(Debug, Clone)]
pub(crate) struct Yardstick {
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Yardstick {
    /// For a balanced plant: `b_i K(i, j) c_j` is compared with the largest entry of A. Without dynamics of its own to
    /// compare with, the units are those of the plant.
    pub(crate) fn new(model: &Model) -> Self {
        let p = &model.plant;
        let n = p.states();
        let (nw, nz) = (p.inputs() - model.controls, p.outputs() - model.measurements);
        let length = |entries: &mut dyn Iterator<Item = f64>| entries.map(|x| x * x).sum::<f64>().sqrt();
        let mut rows: Vec<f64> = (0..model.controls)
            .map(|i| length(&mut (0..n).map(|s| p.b[(s, nw + i)])))
            .collect();
        let mut columns: Vec<f64> = (0..model.measurements)
            .map(|j| length(&mut (0..n).map(|s| p.c[(nz + j, s)])))
            .collect();
        let speed = linalg::max_abs(&p.a);
        let size = if speed > 0.0 { speed.sqrt() } else { 1.0 };
        for unit in rows.iter_mut().chain(&mut columns) {
            *unit = if *unit > 0.0 && speed > 0.0 { *unit / size } else { 1.0 };
        }
        Self { rows, columns }
    }

    /// How many times faster than the plant the feedback is.
    pub(crate) fn feedback(&self, k: &Matrix) -> f64 {
        let entries = (0..k.nrows()).flat_map(|i| (0..k.ncols()).map(move |j| (i, j)));
        entries
            .map(|(i, j)| (self.rows[i] * k[(i, j)] * self.columns[j]).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

/// The fastest feedback of any model at a point.
pub(super) fn feedback(problem: &Checked, x: &[f64]) -> f64 {
    let blocks = problem.blocks(x);
    let models = problem.models.iter().zip(&problem.yardsticks);
    models
        .map(|(model, yardstick)| yardstick.feedback(&problem.gain(model, &blocks)))
        .fold(0.0, f64::max)
}

/// The price of the feedback at a point, with its gradient, at `rate` for a factor e; `None` outside the region.
pub(super) fn price(problem: &Checked, x: &[f64], rate: f64) -> Option<(f64, Vec<f64>)> {
    let blocks = problem.blocks(x);
    let mut sum = 1.0;
    let mut gradient = vec![0.0; x.len()];
    for (model, yardstick) in problem.models.iter().zip(&problem.yardsticks) {
        let k = problem.gain(model, &blocks);
        let size = yardstick.feedback(&k);
        if size.is_nan() || size > LARGEST {
            return None;
        }
        sum += size * size;
        let in_k = Matrix::from_fn(k.nrows(), k.ncols(), |i, j| {
            (yardstick.rows[i] * yardstick.columns[j]).powi(2) * k[(i, j)]
        });
        for (total, own) in gradient.iter_mut().zip(problem.pull_back(model, x, &in_k)) {
            *total += own;
        }
    }
    gradient.iter_mut().for_each(|g| *g *= rate / sum);
    Some((0.5 * rate * sum.ln(), gradient))
}
