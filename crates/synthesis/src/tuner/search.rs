//! One start: stabilise, then alternate descent and finishing.

use std::cell::Cell;

use super::bundle;
use super::descent::{self, Limits};
use super::objective::{Objective, Piece, Value};
use super::options::{Options, Phase, Progress};
use super::problem::Checked;
use super::region;
use crate::linalg::LinalgError;

/// During the search, a channel with all known peaks below this fraction of the largest one is accepted without proof.
const SCREEN: f64 = 0.7;
/// Relative accuracy of the norms of a result.
pub(super) const REPORTED: f64 = 1e-8;
/// Fastest feedback of a stabilising gain, in multiples of the plant.
const STABILISING: f64 = 1e5;

/// Result of a start.
pub(super) struct Outcome {
    pub(super) x: Vec<f64>,
    pub(super) value: Value,
    pub(super) evaluations: usize,
}

/// One start and its data.
pub(super) struct Search<'a> {
    pub(super) checked: &'a Checked,
    pub(super) options: &'a Options,
    pub(super) index: usize,
    pub(super) threads: usize,
    pub(super) report: &'a dyn Fn(Progress) -> bool,
}

impl Search<'_> {
    /// All phases from `x`.
    pub(super) fn run(&self, mut x: Vec<f64>) -> Result<Outcome, LinalgError> {
        let mut objective = Objective::new(self.checked, 1e-7, self.threads).screened(SCREEN);
        let abscissa = self.stabilise(&objective, &mut x)?;
        self.improve(&mut objective, &mut x, region::PRICE)?;
        // The reported evaluation skips no channel.
        let mut careful = Objective::new(self.checked, REPORTED, self.threads);
        let mut value = careful.reported(&x)?;
        if value.gamma.is_infinite() {
            value.abscissa = abscissa.max(value.abscissa);
        }
        Ok(Outcome {
            x,
            value,
            evaluations: objective.evaluations + careful.evaluations,
        })
    }

    /// Lowers the norm, with this penalty on growing gains, from a stabilising `x`; any other `x` is left unchanged.
    pub(super) fn improve(
        &self,
        objective: &mut Objective<'_>,
        x: &mut Vec<f64>,
        rate: f64,
    ) -> Result<(), LinalgError> {
        let (checked, options) = (self.checked, self.options);
        let (first, gradient) = objective.norm(x, f64::INFINITY)?;
        let Some(price) = region::price(checked, x, rate).filter(|_| first.gamma > 0.0 && first.gamma.is_finite())
        else {
            return Ok(()); // Not stabilised, beyond the region, or nothing to minimise.
        };
        let (mut best, mut gradient) = priced(first.gamma, &gradient, &price);
        let limits = Limits {
            iterations: options.iterations,
            gain: options.tolerance,
            window: 20,
        };
        let go = Cell::new(true);
        let watch = |phase| self.reports(phase, &go);
        let mut metric = None;
        for _ in 0..options.rounds.max(1) {
            let before = best;
            let descend = |x: &[f64], ceiling: f64| -> descent::Evaluation<LinalgError> {
                let Some(price) = region::price(checked, x, rate) else {
                    return Ok((f64::INFINITY, Vec::new()));
                };
                // A trial point far away may overflow; it is rejected.
                Ok(match objective.norm(x, (ceiling - price.0).exp()) {
                    Ok((value, _)) if value.gamma.is_infinite() => (f64::INFINITY, Vec::new()),
                    Ok((value, gradient)) => priced(value.gamma, &gradient, &price),
                    Err(_) => (f64::INFINITY, Vec::new()),
                })
            };
            let (_, learnt) = descent::bfgs(x, best, gradient, metric, limits, descend, watch(Phase::Descend))?;
            if !go.get() {
                break;
            }
            let mut in_logs = |x: &[f64]| -> bundle::Pieces<LinalgError> {
                let Some(price) = region::price(checked, x, rate) else {
                    return Ok((f64::INFINITY, Vec::new()));
                };
                let piece = |p: &Piece| {
                    let (value, gradient) = priced(p.value, &p.gradient, &price);
                    Piece { value, gradient }
                };
                Ok(match objective.pieces(x, 0.9) {
                    Ok((value, pieces)) => (priced(value.gamma, &[], &price).0, pieces.iter().map(piece).collect()),
                    Err(_) => (f64::INFINITY, Vec::new()),
                })
            };
            let here = in_logs(x)?;
            let gain = 0.1 * options.tolerance;
            best = bundle::finish(x, here, &learnt, options.finishing, gain, in_logs, watch(Phase::Finish))?;
            if !go.get() || before - best < options.tolerance {
                break;
            }
            metric = Some(learnt);
            let (value, fresh) = objective.norm(x, f64::INFINITY)?;
            let Some(price) = region::price(checked, x, rate) else {
                break;
            };
            (best, gradient) = priced(value.gamma, &fresh, &price);
        }
        Ok(())
    }

    /// Reports the logarithm of a norm after each step of a phase, and stores in `go` whether the search continues.
    fn reports<'b>(&'b self, phase: Phase, go: &'b Cell<bool>) -> impl FnMut(&[f64], f64) -> bool + 'b {
        move |_: &[f64], value: f64| {
            let value = value.exp();
            go.set((self.report)(Progress {
                start: self.index,
                phase,
                value,
                best: value,
            }));
            go.get()
        }
    }

    /// Descends on the spectral abscissa until it is slightly negative, in a few descents (a fresh metric takes BFGS past the
    /// kinks at which several eigenvalues coincide).
    fn stabilise(&self, objective: &Objective<'_>, x: &mut Vec<f64>) -> Result<f64, LinalgError> {
        let size = objective
            .problem
            .models
            .iter()
            .map(|m| crate::linalg::max_abs(&m.plant.a))
            .fold(1.0, f64::max);
        let enough = -1e-6 * size.min(1e3);
        let evaluate = |x: &[f64], _: f64| -> descent::Evaluation<LinalgError> {
            // The speed of the loop is not an objective here, and without a limit it would grow without bound.
            if region::feedback(self.checked, x) > STABILISING {
                return Ok((f64::INFINITY, Vec::new()));
            }
            Ok(objective
                .abscissa(x)
                .ok()
                .flatten()
                .unwrap_or((f64::INFINITY, Vec::new())))
        };
        let limits = Limits {
            iterations: 150,
            gain: 1e-9 * size.min(1e3),
            window: 25,
        };
        let mut abscissa = f64::INFINITY;
        let mut go = true;
        for _ in 0..3 {
            let Some((value, gradient)) = objective.abscissa(x)? else {
                break;
            };
            abscissa = value;
            if abscissa < enough || !go {
                break;
            }
            abscissa = descent::bfgs(x, value, gradient, None, limits, evaluate, |_, value| {
                go = (self.report)(Progress {
                    start: self.index,
                    phase: Phase::Stabilise,
                    value,
                    best: f64::INFINITY,
                });
                go && value >= enough
            })?
            .0;
        }
        Ok(abscissa)
    }
}

/// The logarithm of a norm with the price for growing gains, and its gradient.
fn priced(gamma: f64, gradient: &[f64], (price, slope): &(f64, Vec<f64>)) -> (f64, Vec<f64>) {
    // A norm of zero cannot be lowered: its logarithm is cut off and its gradient empty.
    let factor = if gamma > 0.0 { 1.0 / gamma } else { 0.0 };
    let own = |(i, s): (usize, &f64)| s + factor * gradient.get(i).copied().unwrap_or(0.0);
    (
        gamma.max(f64::MIN_POSITIVE).ln() + price,
        slope.iter().enumerate().map(own).collect(),
    )
}
