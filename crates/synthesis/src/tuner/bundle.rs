//! The finishing phase: a proximal bundle method on the smooth pieces of the objective.
//!
//! BFGS gets close to a nonsmooth minimum but stalls at a kink that it cannot identify. Here all pieces near the maximum (other
//! channels, other peaks, other singular values, and pieces found at nearby points) enter one quadratic program; its solution
//! is a step that lowers them together (Apkarian, Noll and Prot 2008; Kiwiel 1985 for the bundle management).

use super::objective::Piece;
use super::qp::{combine, dot, length, simplex_qp};

/// Evaluation in a bundle phase: the value and the pieces near the maximum, in the same units.
pub(crate) type Pieces<E> = Result<(f64, Vec<Piece>), E>;

struct Cut {
    value: f64,
    gradient: Vec<f64>,
    at: Vec<f64>,
}

impl Cut {
    /// Pieces found at x.
    fn of(pieces: Vec<Piece>, x: &[f64]) -> Vec<Cut> {
        pieces
            .into_iter()
            .map(|p| Cut {
                value: p.value,
                gradient: p.gradient,
                at: x.to_vec(),
            })
            .collect()
    }

    /// Its linearisation at x, shifted below the value there if curvature has put it above.
    fn at(&self, x: &[f64], value: f64) -> f64 {
        let d: Vec<f64> = x.iter().zip(&self.at).map(|(a, b)| a - b).collect();
        (self.value + dot(&self.gradient, &d)).min(value - 1e-3 * dot(&d, &d))
    }
}

/// Improves `x` (with its value and pieces) until the model predicts less than `gain`, or for `steps` evaluations. Lengths are
/// measured in BFGS's inverse Hessian approximation (Lukšan and Vlček 1999), which contains the steep directions.
pub(crate) fn finish<E>(
    x: &mut Vec<f64>,
    (mut value, pieces): (f64, Vec<Piece>),
    metric: &[Vec<f64>],
    steps: usize,
    gain: f64,
    mut f: impl FnMut(&[f64]) -> Pieces<E>,
    mut watch: impl FnMut(&[f64], f64) -> bool,
) -> Result<f64, E> {
    let mut cuts = Cut::of(pieces, x);
    let cuts_max = 3 * x.len() / 2 + 40;
    // A metric that is flat across a kink would trap the search there, so a small multiple of the identity is added.
    let floor = 0.02 * (0..x.len()).map(|i| metric[i][i]).fold(0.0, f64::max);
    let times = |g: &[f64]| -> Vec<f64> {
        let rows = metric.iter().zip(g);
        rows.map(|(row, own)| dot(row, g) + floor * own).collect()
    };
    let mut t = 1.0;
    for _ in 0..steps {
        if cuts.is_empty() {
            break; // Nothing can be lowered.
        }
        let level: Vec<f64> = cuts.iter().map(|c| c.at(x, value) - value).collect();
        let gradients: Vec<Vec<f64>> = cuts.iter().map(|c| c.gradient.clone()).collect();
        let scaled_gradients: Vec<Vec<f64>> = gradients.iter().map(|g| times(g)).collect();
        let gram: Vec<Vec<f64>> = gradients
            .iter()
            .map(|a| scaled_gradients.iter().map(|b| t * dot(a, b)).collect())
            .collect();
        let lambda = simplex_qp(&gram, &level);
        let aggregate = combine(&gradients, &lambda);
        let step = times(&aggregate);
        let predicted = -t * dot(&aggregate, &step) + dot(&level, &lambda);
        if -predicted < gain {
            // Little predicted gain at this step length; try a longer one, unless it was tried before.
            if t * length(&step) > 0.5 || -predicted < 0.01 * gain {
                break;
            }
            t *= 4.0;
            continue;
        }
        let trial: Vec<f64> = x.iter().zip(&step).map(|(a, g)| a - t * g).collect();
        let (trial_value, trial_pieces) = f(&trial)?;
        let achieved = value - trial_value;
        let at = if trial_value.is_finite() {
            Cut::of(trial_pieces, &trial)
        } else {
            Vec::new()
        };
        if trial_value.is_finite() && achieved >= -0.1 * predicted {
            *x = trial;
            value = trial_value;
            if !watch(x, value) {
                break;
            }
            if achieved >= -0.5 * predicted {
                t *= 2.0;
            }
        } else if !trial_value.is_finite() || achieved < 2.0 * predicted {
            t *= 0.25;
        } else {
            t *= 0.7;
        }
        if cuts.len() + at.len() > cuts_max {
            prune_cuts(&mut cuts, &lambda, cuts_max.saturating_sub(at.len()));
        }
        cuts.extend(at);
    }
    Ok(value)
}

/// Keeps at most `cuts_max` of the cuts, and all with nonzero weight. Of those without weight the oldest are removed first.
fn prune_cuts(cuts: &mut Vec<Cut>, weights: &[f64], cuts_max: usize) {
    let mut keep: Vec<bool> = weights.iter().map(|l| *l > 1e-6).collect();
    let mut free_slots = cuts_max.saturating_sub(keep.iter().filter(|k| **k).count());
    for i in (0..cuts.len()).rev() {
        if !keep[i] && free_slots > 0 {
            keep[i] = true;
            free_slots -= 1;
        }
    }
    let mut flags = keep.into_iter();
    cuts.retain(|_| flags.next().unwrap_or(false));
}
