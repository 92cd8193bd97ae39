//! Gain units: a gain of one unit makes the feedback as fast as the plant.

use crate::linalg::{self, Matrix};
use crate::state_space::StateSpace;

/// Units in which a gain matrix is as fast as its plant: K(i, j) is measured in `1/(rows[i] · columns[j])`.
#[derive(Debug, Clone)]
pub(crate) struct GainUnits {
    pub(super) rows: Vec<f64>,
    pub(super) columns: Vec<f64>,
}

impl GainUnits {
    /// For a balanced plant: `b_i K(i, j) c_j` is compared with the largest entry of A. Without dynamics of its own to
    /// compare with, the units are those of the plant. The last `controls` inputs and `measurements` outputs are the loop's.
    pub(crate) fn new(p: &StateSpace, controls: usize, measurements: usize) -> Self {
        let n = p.states();
        let (nw, nz) = (p.inputs() - controls, p.outputs() - measurements);
        let length = |entries: &mut dyn Iterator<Item = f64>| entries.map(|x| x * x).sum::<f64>().sqrt();
        let mut rows: Vec<f64> = (0..controls)
            .map(|i| length(&mut (0..n).map(|s| p.b[(s, nw + i)])))
            .collect();
        let mut columns: Vec<f64> = (0..measurements)
            .map(|j| length(&mut (0..n).map(|s| p.c[(nz + j, s)])))
            .collect();
        let speed = linalg::max_abs(&p.a);
        let size = if speed > 0.0 { speed.sqrt() } else { 1.0 };
        for unit in rows.iter_mut().chain(&mut columns) {
            *unit = if *unit > 0.0 && speed > 0.0 { *unit / size } else { 1.0 };
        }
        Self { rows, columns }
    }

    /// Speed of the feedback in multiples of the plant's.
    pub(crate) fn feedback(&self, k: &Matrix) -> f64 {
        let entries = (0..k.nrows()).flat_map(|i| (0..k.ncols()).map(move |j| (i, j)));
        entries
            .map(|(i, j)| (self.rows[i] * k[(i, j)] * self.columns[j]).powi(2))
            .sum::<f64>()
            .sqrt()
    }
}
