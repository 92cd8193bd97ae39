//! The whole procedure: tune, report at the higher order, validate, let the adversary add models, repeat.

use super::body::{Robot, RobotError};
use super::plant::{Gains, generalised_plant, problem};
use super::spec::{ModelSpec, Spec};
use super::validate::{ValidateError, Validation, validate, worsen};
use crate::full_order::{FullOrderError, full_order_optimum};
use crate::linalg::{self, Matrix};
use crate::tuner::{Evaluation, Flow, Options, Problem, Progress, Tuned, evaluate, tune};

/// What the procedure is doing.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Tuning.
    Tune(Progress),
    /// Validating; samples done.
    Validate(usize),
    /// The adversary added a model with this gamma.
    Adversary(f64),
}

/// The result of [`design`].
#[derive(Debug, Clone)]
pub struct Design {
    /// The gains.
    pub gains: Gains,
    /// The problem that was tuned, adversary's models included, at the tuning order.
    pub problem: Problem,
    /// What the tuner said.
    pub tuned: Tuned,
    /// The same problem and gains at the reporting order.
    pub reported_problem: Problem,
    /// Norms there.
    pub reported: Evaluation,
    /// The validation, if the specification asks for one.
    pub validation: Option<Validation>,
    /// Models that the adversary added.
    pub adversary: Vec<ModelSpec>,
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
/// # Errors
/// A specification that does not fit, a plant that cannot be stabilised, no stabilising gain found.
pub fn design(
    spec: &Spec,
    robot: &Robot,
    threads: usize,
    watch: &(dyn Fn(Step) -> Flow + Sync),
) -> Result<Design, ValidateError> {
    let mut adversary: Vec<ModelSpec> = Vec::new();
    let mut options = options(spec, threads);
    let mut start: Option<Gains> = None;
    loop {
        let problem_now = problem(spec, robot, &adversary, spec.sampling.pade_order_tuning, start.as_ref())?;
        let tuned = tune(&problem_now, &options, &|p| watch(Step::Tune(p)))?;
        let gains = to_gains(spec, &tuned.gains);
        let validation = if spec.validation.samples > 0 && !tuned.stopped {
            Some(validate(spec, robot, &gains, &|done| {
                watch(Step::Validate(done));
            })?)
        } else {
            None
        };
        let again = validation
            .as_ref()
            .filter(|v| !v.passed() && adversary.len() < spec.validation.rounds);
        if let Some(worst) = again.and_then(|v| v.samples.first()) {
            let mut found = worsen(spec, robot, &gains, worst, 15)?;
            found.model.name = format!("adversary {}", adversary.len() + 1);
            watch(Step::Adversary(found.gamma));
            adversary.push(found.model);
            // The gains so far are a good start for the harder problem; wide scatter would only forget them.
            start = Some(gains);
            options.scatter *= 0.5;
            continue;
        }
        let reported_problem = problem(
            spec,
            robot,
            &adversary,
            spec.sampling.pade_order_reporting,
            Some(&gains),
        )?;
        let reported = evaluate(&reported_problem)?;
        return Ok(Design {
            gains,
            problem: problem_now,
            tuned,
            reported_problem,
            reported,
            validation,
            adversary,
        });
    }
}

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

/// Why the full-order optimum of a specification cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptimumError {
    /// The robot or the specification.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The computation.
    #[error(transparent)]
    FullOrder(#[from] FullOrderError),
}

/// The full-order optimum of the tracking channel of one model, at the tuning order: what any linear controller could reach
/// there, as a bracket. Disturbances enter with a thousandth of their size: without them the integrators of the plant
/// would be invisible zeros on the imaginary axis and the Riccati equations would have no solution.
///
/// # Errors
/// A specification that does not fit.
pub fn tracking_optimum(spec: &Spec, robot: &Robot, model: &ModelSpec) -> Result<(f64, f64), OptimumError> {
    let n = robot.channels();
    // The measurement of the integral is a function of the measurement of the error: a full-order controller has its own.
    let mut plain = spec.clone();
    plain.gains.integral = false;
    plain.weights.load = None;
    let body = robot.body(model)?;
    let mut p = generalised_plant(&plain, &body, model, spec.sampling.pade_order_tuning)?;
    for i in 0..p.states() {
        for j in n..2 * n {
            p.b[(i, j)] *= 1e-3;
        }
    }
    debug_assert_eq!(linalg::max_abs(&linalg::sub(&p.d, 0, n, p.outputs(), n)), 0.0);
    Ok(full_order_optimum(&p, n, n, 1e-4)?)
}
