//! One start: stabilise, then alternate descent and finishing.

use std::cell::Cell;

use super::bundle;
use super::descent::{self, Limits};
use super::growth_penalty;
use super::objective::{Objective, ObjectiveValue, Piece};
use super::options::{Options, Phase, TuningProgress};
use super::problem::ValidatedProblem;
use crate::linalg::LinalgError;

/// During the search, a channel with all known peaks below this fraction of the largest one is accepted without proof.
const SCREENING_FRACTION: f64 = 0.7;
/// Relative accuracy of the norms of a result.
pub(super) const REPORTED: f64 = 1e-8;
/// Fastest feedback of a stabilising gain, in multiples of the plant.
const STABILISING: f64 = 1e5;

/// Result of a start.
pub(super) struct Outcome {
    pub(super) x: Vec<f64>,
    pub(super) value: ObjectiveValue,
    pub(super) evaluations: usize,
}

/// One start and its data.
pub(super) struct Search<'a> {
    pub(super) checked: &'a ValidatedProblem,
    pub(super) options: &'a Options,
    pub(super) index: usize,
    pub(super) threads: usize,
    pub(super) report: &'a dyn Fn(TuningProgress) -> bool,
}

impl Search<'_> {
    /// All phases from `x`.
    pub(super) fn run(&self, mut x: Vec<f64>) -> Result<Outcome, LinalgError> {
        let mut objective = Objective::new(self.checked, 1e-7, self.threads).screened(SCREENING_FRACTION);
        let abscissa = self.stabilise(&objective, &mut x)?;
        self.improve(&mut objective, &mut x, growth_penalty::WEIGHT)?;
        // The reported evaluation skips no channel.
        let mut reporting = Objective::new(self.checked, REPORTED, self.threads);
        let mut value = reporting.reported(&x)?;
        if value.gamma.is_infinite() {
            value.abscissa = abscissa.max(value.abscissa);
        }
        Ok(Outcome {
            x,
            value,
            evaluations: objective.evaluations + reporting.evaluations,
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
        let Some(penalty) =
            growth_penalty::penalty(checked, x, rate).filter(|_| first.gamma > 0.0 && first.gamma.is_finite())
        else {
            return Ok(()); // Not stabilised, beyond the region, or nothing to minimise.
        };
        let (mut best, mut gradient) = penalised(first.gamma, &gradient, &penalty);
        let limits = Limits {
            iterations: options.iterations,
            gain: options.tolerance,
            window: 20,
        };
        let running = Cell::new(true);
        let watch = |phase| self.progress_reporter(phase, &running);
        let mut metric = None;
        for _ in 0..options.rounds.max(1) {
            let before = best;
            let descend = |x: &[f64], ceiling: f64| -> descent::Evaluation<LinalgError> {
                let Some(penalty) = growth_penalty::penalty(checked, x, rate) else {
                    return Ok((f64::INFINITY, Vec::new()));
                };
                // A trial point far away may overflow; it is rejected.
                Ok(match objective.norm(x, libm::exp(ceiling - penalty.0)) {
                    Ok((value, _)) if value.gamma.is_infinite() => (f64::INFINITY, Vec::new()),
                    Ok((value, gradient)) => penalised(value.gamma, &gradient, &penalty),
                    Err(_) => (f64::INFINITY, Vec::new()),
                })
            };
            let (_, inverse_hessian) =
                descent::bfgs(x, best, gradient, metric, limits, descend, watch(Phase::Descend))?;
            if !running.get() {
                break;
            }
            let mut log_pieces = |x: &[f64]| -> bundle::Pieces<LinalgError> {
                let Some(penalty) = growth_penalty::penalty(checked, x, rate) else {
                    return Ok((f64::INFINITY, Vec::new()));
                };
                let piece = |p: &Piece| {
                    let (value, gradient) = penalised(p.value, &p.gradient, &penalty);
                    Piece { value, gradient }
                };
                Ok(match objective.pieces(x, 0.9) {
                    Ok((value, pieces)) => (
                        penalised(value.gamma, &[], &penalty).0,
                        pieces.iter().map(piece).collect(),
                    ),
                    Err(_) => (f64::INFINITY, Vec::new()),
                })
            };
            let current = log_pieces(x)?;
            let gain = 0.1 * options.tolerance;
            best = bundle::finish(
                x,
                current,
                &inverse_hessian,
                options.finishing,
                gain,
                log_pieces,
                watch(Phase::Finish),
            )?;
            if !running.get() || before - best < options.tolerance {
                break;
            }
            metric = Some(inverse_hessian);
            let (value, new_gradient) = objective.norm(x, f64::INFINITY)?;
            let Some(penalty) = growth_penalty::penalty(checked, x, rate) else {
                break;
            };
            (best, gradient) = penalised(value.gamma, &new_gradient, &penalty);
        }
        Ok(())
    }

    /// Reports the logarithm of a norm after each step of a phase, and stores in `running` whether the search continues.
    fn progress_reporter<'b>(&'b self, phase: Phase, running: &'b Cell<bool>) -> impl FnMut(&[f64], f64) -> bool + 'b {
        move |_: &[f64], value: f64| {
            let value = libm::exp(value);
            running.set((self.report)(TuningProgress {
                start: self.index,
                phase,
                value,
                best: value,
            }));
            running.get()
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
        let target = -1e-6 * size.min(1e3);
        let evaluate = |x: &[f64], _: f64| -> descent::Evaluation<LinalgError> {
            // The speed of the loop is not an objective here, and without a limit it would grow without bound.
            if growth_penalty::feedback(self.checked, x) > STABILISING {
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
        let mut running = true;
        for _ in 0..3 {
            let Some((value, gradient)) = objective.abscissa(x)? else {
                break;
            };
            abscissa = value;
            if abscissa < target || !running {
                break;
            }
            abscissa = descent::bfgs(x, value, gradient, None, limits, evaluate, |_, value| {
                running = (self.report)(TuningProgress {
                    start: self.index,
                    phase: Phase::Stabilise,
                    value,
                    best: f64::INFINITY,
                });
                running && value >= target
            })?
            .0;
        }
        Ok(abscissa)
    }
}

/// The logarithm of a norm with the penalty on growing gains, and its gradient.
fn penalised(gamma: f64, gradient: &[f64], (penalty, slope): &(f64, Vec<f64>)) -> (f64, Vec<f64>) {
    // A norm of zero cannot be lowered: its logarithm is cut off and its gradient empty.
    let factor = if gamma > 0.0 { 1.0 / gamma } else { 0.0 };
    let own = |(i, s): (usize, &f64)| s + factor * gradient.get(i).copied().unwrap_or(0.0);
    (
        libm::log(gamma.max(f64::MIN_POSITIVE)) + penalty,
        slope.iter().enumerate().map(own).collect(),
    )
}
