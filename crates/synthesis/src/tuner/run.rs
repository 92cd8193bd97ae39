//! The phases of one start, several starts, and the report.

use std::sync::atomic::{AtomicBool, Ordering};

use super::certificate::{Certificate, certify};
use super::objective::{Objective, ObjectiveValue};
use super::options::{Options, SearchControl, TuningProgress};
use super::problem::{Problem, TuneError, ValidatedProblem};
use super::search::{Outcome, REPORTED, Search};
use super::state_feedback;
use super::verdict::Verdict;
use crate::linalg::{LinalgError, Matrix};
use crate::parallel;
use crate::rng::Rng;

/// Norm of one channel of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelReport {
    /// Name of the model.
    pub model: String,
    /// Name of the channel.
    pub channel: String,
    /// Its H-infinity norm, exact to 1e-7 relative.
    pub norm: f64,
    /// Frequency of its peak, rad per unit of time.
    pub omega: f64,
}

/// The value of given gains.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Largest channel norm, infinite when a model is unstable.
    pub gamma: f64,
    /// Largest spectral abscissa of the models.
    pub abscissa: f64,
    /// Norm per model and channel; empty when unstable.
    pub channels: Vec<ChannelReport>,
}

/// The result of [`tune`].
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned {
    /// The gain blocks, in the order of the problem.
    pub gains: Vec<Matrix>,
    /// The controller gain matrix K of every model.
    pub controllers: Vec<Matrix>,
    /// Largest channel norm, abscissa and channel norms.
    pub evaluation: Evaluation,
    /// Evidence of local optimality.
    pub certificate: Certificate,
    /// Whether an optimum was attained.
    pub verdict: Verdict,
    /// Gamma of every start, infinite where none was stabilised.
    pub starts: Vec<f64>,
    /// Whether the caller stopped the run before it was done.
    pub stopped: bool,
    /// Norm evaluations of all starts together.
    pub evaluations: usize,
}

/// Tunes the gains of `problem`. `watch` is called from the worker threads after every accepted step.
///
/// # Errors
/// An inconsistent problem, a plant that no controller can stabilise, start gains outside their structure, or no stabilising
/// gain found (with the least abscissa reached).
pub fn tune(
    problem: &Problem,
    options: &Options,
    watch: &(dyn Fn(TuningProgress) -> SearchControl + Sync),
) -> Result<Tuned, TuneError> {
    let checked = ValidatedProblem::new(problem)?;
    let requested = options.starts.max(1);
    let riccati_start = state_feedback::start(&checked)?;
    let starts = requested + usize::from(riccati_start.is_some());
    let stop = AtomicBool::new(false);
    // Starts first; the remaining threads share the models of a start.
    let workers = options.threads.clamp(1, starts);
    let inner = (options.threads / workers).max(1);
    let outcomes = parallel::map(starts, workers, |index| {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let report = |progress: TuningProgress| {
            if watch(progress) == SearchControl::Stop {
                stop.store(true, Ordering::Relaxed);
            }
            !stop.load(Ordering::Relaxed)
        };
        let from = match &riccati_start {
            Some(x) if index == requested => x.clone(),
            _ => start_parameters(&checked, options, index),
        };
        let search = Search {
            checked: &checked,
            options,
            index,
            threads: inner,
            report: &report,
        };
        Some(search.run(from))
    });
    let stopped = stop.load(Ordering::Relaxed);
    // A start that was never begun (after a stop) or whose iteration broke down counts as not stabilised.
    let outcomes: Vec<Option<Outcome>> = outcomes.into_iter().map(|outcome| outcome?.ok()).collect();
    let gamma = |outcome: &Option<Outcome>| outcome.as_ref().map_or(f64::INFINITY, |outcome| outcome.value.gamma);
    let gammas = outcomes.iter().map(gamma).collect();
    let evaluations = outcomes.iter().flatten().map(|outcome| outcome.evaluations).sum();
    let Some(best) = best_of(outcomes) else {
        return Err(LinalgError::NoConvergence {
            what: "eigenvalue",
            size: checked.models[0].plant.states(),
        }
        .into());
    };
    if best.value.gamma.is_infinite() {
        return Err(not_stabilised(best, starts, stopped));
    }
    let mut objective = Objective::new(&checked, 1e-7, options.threads);
    let certificate = if options.certify {
        certify(&mut objective, &best.x, options.seed)?
    } else {
        Certificate::NONE
    };
    let gains = checked.blocks(&best.x);
    let controllers = checked.models.iter().map(|m| checked.gain(m, &gains)).collect();
    let verdict = Verdict::of(&checked, options, &best.x, &best.value)?;
    let evaluation = report(&checked, &best.value);
    Ok(Tuned {
        gains,
        controllers,
        evaluation,
        certificate,
        verdict,
        starts: gammas,
        stopped,
        evaluations,
    })
}

/// The start with the least norm; if none is stabilised, the one nearest to stability.
fn best_of(outcomes: Vec<Option<Outcome>>) -> Option<Outcome> {
    outcomes.into_iter().flatten().reduce(|best, outcome| {
        let (own, other) = (&outcome.value, &best.value);
        let better = own.gamma < other.gamma
            || (own.gamma.is_infinite() && other.gamma.is_infinite() && own.abscissa < other.abscissa);
        if better { outcome } else { best }
    })
}

/// Why there is no result when the best of all starts is not stabilised.
fn not_stabilised(best: Outcome, starts: usize, stopped: bool) -> TuneError {
    if stopped {
        return TuneError::Stopped(best.value.abscissa);
    }
    TuneError::NotStabilised {
        starts,
        abscissa: best.value.abscissa,
        parameters: best.x,
    }
}

/// The channel norms at the start values of the gains.
///
/// # Errors
/// As [`tune`], except that unstable gains give an infinite gamma.
pub fn evaluate(problem: &Problem) -> Result<Evaluation, TuneError> {
    let checked = ValidatedProblem::new(problem)?;
    let x = vec![0.0; checked.parameters()];
    let value = Objective::new(&checked, REPORTED, 1).reported(&x)?;
    Ok(report(&checked, &value))
}

/// The gain blocks at their start values, and the resulting controller gain matrix K of every model.
///
/// # Errors
/// As [`evaluate`].
pub fn controllers(problem: &Problem) -> Result<(Vec<Matrix>, Vec<Matrix>), TuneError> {
    let checked = ValidatedProblem::new(problem)?;
    let blocks = checked.blocks(&vec![0.0; checked.parameters()]);
    let controllers = checked.models.iter().map(|m| checked.gain(m, &blocks)).collect();
    Ok((blocks, controllers))
}

fn report(checked: &ValidatedProblem, value: &ObjectiveValue) -> Evaluation {
    let mut channels = Vec::new();
    for (model, norms) in checked.models.iter().zip(&value.channels) {
        for (channel, norm) in model.channels.iter().zip(norms) {
            channels.push(ChannelReport {
                model: model.name.clone(),
                channel: channel.name.clone(),
                norm: norm.gain,
                omega: norm.omega,
            });
        }
    }
    Evaluation {
        gamma: value.gamma,
        abscissa: value.abscissa,
        channels,
    }
}

/// A start value for start number `index`.
fn start_parameters(checked: &ValidatedProblem, options: &Options, index: usize) -> Vec<f64> {
    if index == 0 {
        return vec![0.0; checked.parameters()];
    }
    let mut rng = Rng::new(options.seed, index as u64);
    // Relative parameters stay near their start. For the others even the order of magnitude is unknown, so every third start
    // is scattered three times and every third one nine times as far.
    let reach = 3f64.powi((index as i32 - 1) % 3);
    let mut x = Vec::new();
    for g in &checked.gains {
        let spread = if g.relative() {
            0.5 * options.scatter
        } else {
            reach * options.scatter
        };
        x.extend((0..g.block.kind.parameters()).map(|_| spread * rng.normal()));
    }
    x
}
