//! Growth penalty: the size of the feedback relative to its plant, and the limit of the search region.
//!
//! Some infima lie at infinite gain. A search on gamma alone follows them until rounding dominates its value. So growth is
//! penalised: a factor e in the feedback must lower gamma by a millionth, which is negligible for an optimum at a finite
//! gain, and beyond [`FEEDBACK_MAX`] nothing is evaluated.

use super::problem::ValidatedProblem;
use crate::linalg::Matrix;

/// Reduction of ln γ required of a factor e in a large feedback.
pub(super) const WEIGHT: f64 = 1e-6;
/// Feedback beyond which nothing is evaluated, in multiples of the plant.
pub(super) const FEEDBACK_MAX: f64 = 1e10;

/// The fastest feedback of any model at a point.
pub(super) fn feedback(problem: &ValidatedProblem, x: &[f64]) -> f64 {
    let blocks = problem.blocks(x);
    let models = problem.models.iter().zip(&problem.gain_units);
    models
        .map(|(model, units)| units.feedback(&problem.gain(model, &blocks)))
        .fold(0.0, f64::max)
}

/// The penalty on the feedback at a point, with its gradient, at `rate` for a factor e; `None` outside the region.
pub(super) fn penalty(problem: &ValidatedProblem, x: &[f64], rate: f64) -> Option<(f64, Vec<f64>)> {
    let blocks = problem.blocks(x);
    let mut sum = 1.0;
    let mut gradient = vec![0.0; x.len()];
    for (model, units) in problem.models.iter().zip(&problem.gain_units) {
        let k = problem.gain(model, &blocks);
        let size = units.feedback(&k);
        if size.is_nan() || size > FEEDBACK_MAX {
            return None;
        }
        sum += size * size;
        let in_k = Matrix::from_fn(k.nrows(), k.ncols(), |i, j| {
            (units.rows[i] * units.columns[j]).powi(2) * k[(i, j)]
        });
        for (total, own) in gradient.iter_mut().zip(problem.pull_back(model, x, &in_k)) {
            *total += own;
        }
    }
    gradient.iter_mut().for_each(|g| *g *= rate / sum);
    Some((0.5 * rate * libm::log(sum), gradient))
}
