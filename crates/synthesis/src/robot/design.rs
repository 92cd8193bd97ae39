//! The design procedure: tune, report at the higher order, validate, add models found by the adversary, repeat.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::linearise::{Robot, RobotError};
use super::plant::{Gains, generalised_plant, problem};
use super::spec::{ModelSpec, Spec};
use super::validate::{ValidateError, Validation, adversary, validate};
use crate::full_order::{FullOrderError, full_order_optimum};
use crate::linalg::{self, Matrix};
use crate::tuner::{Evaluation, Options, Problem, SearchControl, Tuned, TuningProgress, evaluate, tune};

/// Stage of the procedure.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Tuning.
    Tune(TuningProgress),
    /// Validating; samples done.
    Validate(usize),
    /// The adversary added models, the worst with this gamma.
    Adversary(f64),
}

/// The result of [`design`].
#[derive(Debug, Clone)]
pub struct Design {
    /// The gains.
    pub gains: Gains,
    /// The problem that was tuned, adversary's models included, at the tuning order.
    pub problem: Problem,
    /// The tuner's result.
    pub tuned: Tuned,
    /// The same problem and gains at the reporting order.
    pub reported_problem: Problem,
    /// Norms there.
    pub reported: Evaluation,
    /// The validation, if the specification requests one.
    pub validation: Option<Validation>,
    /// Models that the adversary added.
    pub adversary: Vec<ModelSpec>,
    /// Summary of each round.
    pub rounds: Vec<Round>,
}

/// One tuning and its validation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    /// Number of models tuned for.
    pub models: usize,
    /// Gamma on them.
    pub gamma: f64,
    /// Situations of the validation set that are unstable.
    pub unstable: usize,
    /// Stable ones above the limit.
    pub above: usize,
    /// Largest gamma of the stable ones.
    pub worst_gamma: f64,
}

/// Options of the tuner from the specification.
pub fn options(spec: &Spec, threads: usize) -> Options {
    let s = &spec.search;
    Options {
        starts: s.starts,
        scatter: s.scatter,
        seed: s.seed,
        iterations: s.iterations,
        finishing: s.finishing,
        rounds: s.rounds,
        tolerance: s.tolerance,
        certify: true,
        threads,
    }
}

fn to_gains(spec: &Spec, blocks: &[Matrix]) -> Gains {
    let ki = blocks
        .get(1)
        .map_or_else(Vec::new, |k| (0..k.nrows()).map(|i| k[(i, i)]).collect());
    Gains {
        structure: spec.gains.structure,
        kp: blocks[0].clone(),
        ki,
    }
}

/// Runs the procedure. `watch` may stop it; the best gains so far are then returned without another round.
///
/// The gains are first tuned for the models of the specification alone. While the validation set does not pass, the adversary adds
/// models and the gains are re-tuned from their present values, with a limited number of iterations because more models will follow;
/// once it passes, they are tuned to convergence and validated again.
///
/// # Errors
/// A specification that does not fit, a plant that cannot be stabilised, no stabilising gain found.
pub fn design(
    spec: &Spec,
    robot: &Robot,
    threads: usize,
    watch: &(dyn Fn(Step) -> SearchControl + Sync),
) -> Result<Design, ValidateError> {
    let first_tuning = options(spec, threads);
    let retuning = Options {
        starts: 1,
        ..first_tuning.clone()
    };
    let short_tuning = Options {
        iterations: SHORT_TUNING_ITERATIONS,
        finishing: SHORT_TUNING_ITERATIONS / 4,
        rounds: 1,
        certify: false,
        ..retuning.clone()
    };
    let order = spec.sampling.pade_order_tuning;
    let mut added: Vec<ModelSpec> = Vec::new();
    let mut rounds: Vec<Round> = Vec::new();
    let mut start: Option<Gains> = None;
    let mut to_convergence = true;
    loop {
        let problem_now = problem(spec, robot, &added, order, start.as_ref())?;
        let options = match (&start, to_convergence) {
            (None, _) => &first_tuning,
            (Some(_), true) => &retuning,
            (Some(_), false) => &short_tuning,
        };
        let tuned = tune(&problem_now, options, &|p| watch(Step::Tune(p)))?;
        let gains = to_gains(spec, &tuned.gains);
        let mut round = Round {
            models: problem_now.models.len(),
            gamma: tuned.evaluation.gamma,
            ..Round::default()
        };
        let stopped = AtomicBool::new(tuned.stopped);
        let validation = if spec.validation.samples > 0 && !tuned.stopped {
            Some(validate(spec, robot, &gains, threads, &|done| {
                if watch(Step::Validate(done)) == SearchControl::Stop {
                    stopped.store(true, Ordering::Relaxed);
                }
            })?)
        } else {
            None
        };
        if let Some(v) = &validation {
            (round.unstable, round.above, round.worst_gamma) = (v.unstable(), v.above(), v.worst_gamma());
        }
        rounds.push(round);
        let passed = validation.as_ref().is_none_or(Validation::passed);
        let exhausted = added.len() >= spec.validation.rounds * spec.validation.added;
        if !stopped.into_inner() && !(to_convergence && (passed || exhausted)) {
            if passed || exhausted {
                to_convergence = true;
            } else {
                let found = adversary(spec, robot, &gains, added.len() / spec.validation.added, threads)?;
                watch(Step::Adversary(found.first().map_or(0.0, |worst| worst.gamma)));
                added.extend(found.into_iter().map(|sample| sample.model));
                to_convergence = false;
            }
            start = Some(gains);
            continue;
        }
        let reporting = spec.sampling.pade_order_reporting;
        let reported_problem = problem(spec, robot, &added, reporting, Some(&gains))?;
        let reported = evaluate(&reported_problem)?;
        return Ok(Design {
            gains,
            problem: problem_now,
            tuned,
            reported_problem,
            reported,
            validation,
            adversary: added,
            rounds,
        });
    }
}

/// BFGS iterations between two rounds of the adversary.
const SHORT_TUNING_ITERATIONS: usize = 60;

/// The norms of given gains on the models of a specification and an adversary's, at the reporting order.
///
/// # Errors
/// A specification that does not fit.
pub fn report(
    spec: &Spec,
    robot: &Robot,
    adversary: &[ModelSpec],
    gains: &Gains,
) -> Result<(Problem, Evaluation), ValidateError> {
    let problem = problem(spec, robot, adversary, spec.sampling.pade_order_reporting, Some(gains))?;
    let evaluation = evaluate(&problem)?;
    Ok((problem, evaluation))
}

/// Errors of computing the full-order optimum of a specification.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptimumError {
    /// An error of the robot or the specification.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// An error of the computation.
    #[error(transparent)]
    FullOrder(#[from] FullOrderError),
}

/// The full-order optimum of the tracking channel of one model, at the tuning order: a bracket of the least norm of any linear
/// controller. Disturbances enter with a thousandth of their size: without them the integrators of the plant would be invisible
/// zeros on the imaginary axis and the Riccati equations would have no solution.
///
/// # Errors
/// A specification that does not fit.
pub fn tracking_optimum(spec: &Spec, robot: &Robot, model: &ModelSpec) -> Result<(f64, f64), OptimumError> {
    let n = robot.channels();
    // The measurement of the integral is a function of the measurement of the error: a full-order controller has its own.
    let mut plain = spec.clone();
    plain.gains.integral = false;
    plain.weights.load = None;
    let body = robot.linearise(model)?;
    let mut p = generalised_plant(&plain, &body, model, spec.sampling.pade_order_tuning)?;
    for i in 0..p.states() {
        for j in n..2 * n {
            p.b[(i, j)] *= 1e-3;
        }
    }
    debug_assert_eq!(linalg::max_abs(&p.d.block(0, n, p.outputs(), n)), 0.0);
    Ok(full_order_optimum(&p, n, n, 1e-4)?)
}
