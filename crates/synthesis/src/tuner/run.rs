//! The phases of one start, several starts, and the report.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bundle;
use super::certificate::{Certificate, certify};
use super::descent::{self, Limits};
use super::objective::{Objective, Piece, Value};
use super::problem::{Checked, Problem, TuneError};
use crate::linalg::{LinalgError, Matrix};
use crate::parallel;
use crate::rng::Rng;

/// How to tune.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Number of starts; the first is the start value of the gains, the others are scattered around it.
    pub starts: usize,
    /// Standard deviation of that scatter: of a logarithm for positive gains, of a parameter unit for full ones.
    pub scatter: f64,
    /// Seed of the scatter and of the sampling for the certificate.
    pub seed: u64,
    /// BFGS iterations per descent.
    pub iterations: usize,
    /// Evaluations per finishing phase.
    pub finishing: usize,
    /// Rounds of descent and finishing.
    pub rounds: usize,
    /// Relative gain below which a phase ends.
    pub tolerance: f64,
    /// Whether to compute the certificate, which costs a hundred evaluations.
    pub certify: bool,
    /// Threads that share the starts and the models; has no influence on the result.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            starts: 3,
            scatter: 1.0,
            seed: 1,
            iterations: 300,
            finishing: 60,
            rounds: 3,
            tolerance: 1e-5,
            certify: true,
            threads: 2,
        }
    }
}

/// What a run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Looking for a stabilising gain.
    Stabilise,
    /// BFGS.
    Descend,
    /// Bundle.
    Finish,
}

/// One line of progress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Which start, from 0.
    pub start: usize,
    /// What it is doing.
    pub phase: Phase,
    /// The abscissa while stabilising, gamma afterwards.
    pub value: f64,
    /// Smallest gamma of this start so far; infinite before the first stabilising gain.
    pub best: f64,
}

/// Whether to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop soon and report the best gains so far.
    Stop,
}

/// Norm of one channel of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelReport {
    /// Name of the model.
    pub model: String,
    /// Name of the channel.
    pub channel: String,
    /// Its H-infinity norm, exact to 1e-7 relative.
    pub norm: f64,
    /// Where it peaks, rad per unit of time.
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
    /// Largest channel norm and what belongs to it.
    pub evaluation: Evaluation,
    /// Evidence of local optimality.
    pub certificate: Certificate,
    /// Gamma of every start, infinite where none was stabilised.
    pub starts: Vec<f64>,
    /// Whether the caller stopped the run before it was done.
    pub stopped: bool,
    /// Norm evaluations of all starts together.
    pub evaluations: usize,
}

/// While searching, a channel whose known peaks all lie below this part of the largest one is believed without a proof.
const SCREEN: f64 = 0.7;

struct Outcome {
    x: Vec<f64>,
    gamma: f64,
    abscissa: f64,
    evaluations: usize,
}

/// Tunes the gains of `problem`. `watch` is called from the worker threads after every accepted step.
///
/// # Errors
/// A problem that does not fit together, a plant that nobody can stabilise, start gains outside their structure, or no
/// stabilising gain found (with the least abscissa reached).
pub fn tune(
    problem: &Problem,
    options: &Options,
    watch: &(dyn Fn(Progress) -> Flow + Sync),
) -> Result<Tuned, TuneError> {
    let checked = Checked::new(problem)?;
    let starts = options.starts.max(1);
    let stop = AtomicBool::new(false);
    // Starts first; threads that are left over share the models of a start.
    let workers = options.threads.clamp(1, starts);
    let inner = (options.threads / workers).max(1);
    let outcomes = parallel::map(starts, workers, |index| {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let report = |progress: Progress| {
            if watch(progress) == Flow::Stop {
                stop.store(true, Ordering::Relaxed);
            }
            !stop.load(Ordering::Relaxed)
        };
        Some(one_start(&checked, options, index, inner, &report))
    });
    let stopped = stop.load(Ordering::Relaxed);
    let mut gammas = Vec::new();
    let mut best: Option<Outcome> = None;
    let mut evaluations = 0;
    for outcome in outcomes {
        // A start that was never begun (after a stop) or whose iteration broke down counts as not stabilised.
        let Some(Ok(outcome)) = outcome else {
            gammas.push(f64::INFINITY);
            continue;
        };
        gammas.push(outcome.gamma);
        evaluations += outcome.evaluations;
        let better = best.as_ref().is_none_or(|b| {
            outcome.gamma < b.gamma
                || (b.gamma.is_infinite() && outcome.gamma.is_infinite() && outcome.abscissa < b.abscissa)
        });
        if better {
            best = Some(outcome);
        }
    }
    let Some(best) = best else {
        return Err(LinalgError::NoConvergence {
            what: "eigenvalue",
            size: checked.models[0].plant.states(),
        }
        .into());
    };
    if best.gamma.is_infinite() {
        return Err(if stopped {
            TuneError::Stopped(best.abscissa)
        } else {
            TuneError::NotStabilised {
                starts,
                abscissa: best.abscissa,
                parameters: best.x,
            }
        });
    }
    let mut objective = Objective::new(&checked, 1e-7, options.threads);
    let certificate = if options.certify {
        certify(&mut objective, &best.x, options.seed)?
    } else {
        Certificate::NONE
    };
    let gains = checked.blocks(&best.x);
    let controllers = checked.models.iter().map(|m| checked.gain(m, &gains)).collect();
    let (value, _) = Objective::new(&checked, 1e-8, options.threads).norm(&best.x, f64::INFINITY)?;
    let evaluation = report(&checked, &value);
    Ok(Tuned {
        gains,
        controllers,
        evaluation,
        certificate,
        starts: gammas,
        stopped,
        evaluations,
    })
}

/// The channel norms at the start values of the gains.
///
/// # Errors
/// As [`tune`], except that unstable gains give an infinite gamma.
pub fn evaluate(problem: &Problem) -> Result<Evaluation, TuneError> {
    let checked = Checked::new(problem)?;
    let x = vec![0.0; checked.parameters()];
    let (value, _) = Objective::new(&checked, 1e-8, 1).norm(&x, f64::INFINITY)?;
    Ok(report(&checked, &value))
}

/// The gain blocks at their start values, and the controller gain matrix K of every model that they make.
///
/// # Errors
/// As [`evaluate`].
pub fn controllers(problem: &Problem) -> Result<(Vec<Matrix>, Vec<Matrix>), TuneError> {
    let checked = Checked::new(problem)?;
    let blocks = checked.blocks(&vec![0.0; checked.parameters()]);
    let controllers = checked.models.iter().map(|m| checked.gain(m, &blocks)).collect();
    Ok((blocks, controllers))
}

fn report(checked: &Checked, value: &Value) -> Evaluation {
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
fn scattered(checked: &Checked, options: &Options, index: usize) -> Vec<f64> {
    if index == 0 {
        return vec![0.0; checked.parameters()];
    }
    let mut rng = Rng::new(options.seed, index as u64);
    // Relative parameters stay near their start. Of the others even the order of magnitude is unknown, so every third start
    // looks three times and every third one nine times as far.
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

fn one_start(
    checked: &Checked,
    options: &Options,
    index: usize,
    threads: usize,
    report: &dyn Fn(Progress) -> bool,
) -> Result<Outcome, LinalgError> {
    let mut x = scattered(checked, options, index);
    let mut objective = Objective::new(checked, 1e-7, threads).screened(SCREEN);
    let mut abscissa = stabilise(&objective, &mut x, index, report)?;
    let (first, gradient) = objective.norm(&x, f64::INFINITY)?;
    if first.gamma.is_infinite() {
        abscissa = abscissa.max(first.abscissa);
        return Ok(Outcome {
            x,
            gamma: f64::INFINITY,
            abscissa,
            evaluations: objective.evaluations,
        });
    }
    let mut best = first.gamma.ln();
    let mut gradient: Vec<f64> = gradient.iter().map(|g| g / first.gamma).collect();
    let limits = Limits {
        iterations: options.iterations,
        gain: options.tolerance,
        window: 20,
    };
    let go = Cell::new(true);
    let watch = |phase| {
        let go = &go;
        move |_: &[f64], value: f64| {
            let value = value.exp();
            go.set(report(Progress {
                start: index,
                phase,
                value,
                best: value,
            }));
            go.get()
        }
    };
    let mut metric = None;
    for _ in 0..options.rounds.max(1) {
        let before = best;
        let descend = |x: &[f64], ceiling: f64| -> descent::Evaluation<LinalgError> {
            // A trial point far out may overflow; it is simply not taken.
            Ok(match objective.norm(x, ceiling.exp()) {
                Ok((value, gradient)) => (value.gamma.ln(), gradient.iter().map(|g| g / value.gamma).collect()),
                Err(_) => (f64::INFINITY, Vec::new()),
            })
        };
        let (_, learnt) = descent::bfgs(&mut x, best, gradient, metric, limits, descend, watch(Phase::Descend))?;
        if !go.get() {
            break;
        }
        let mut in_logs = |x: &[f64]| -> bundle::Pieces<LinalgError> {
            Ok(match objective.pieces(x, 0.9) {
                Ok((value, pieces)) => (value.gamma.ln(), pieces.iter().map(Piece::logarithm).collect()),
                Err(_) => (f64::INFINITY, Vec::new()),
            })
        };
        let here = in_logs(&x)?;
        let gain = 0.1 * options.tolerance;
        best = bundle::finish(
            &mut x,
            here,
            &learnt,
            options.finishing,
            gain,
            in_logs,
            watch(Phase::Finish),
        )?;
        if !go.get() || before - best < options.tolerance {
            break;
        }
        metric = Some(learnt);
        let (value, fresh) = objective.norm(&x, f64::INFINITY)?;
        best = value.gamma.ln();
        gradient = fresh.iter().map(|g| g / value.gamma).collect();
    }
    // What is reported spares nothing.
    let mut objective = objective.screened(0.0);
    let (value, _) = objective.norm(&x, f64::INFINITY)?;
    Ok(Outcome {
        x,
        gamma: value.gamma,
        abscissa: value.abscissa,
        evaluations: objective.evaluations,
    })
}

/// Descends on the spectral abscissa until it is negative by a little, in a few descents (a fresh metric gets BFGS over
/// the kinks at which several eigenvalues meet).
fn stabilise(
    objective: &Objective<'_>,
    x: &mut Vec<f64>,
    index: usize,
    report: &dyn Fn(Progress) -> bool,
) -> Result<f64, LinalgError> {
    let size = objective
        .problem
        .models
        .iter()
        .map(|m| crate::linalg::max_abs(&m.plant.a))
        .fold(1.0, f64::max);
    let enough = -1e-6 * size.min(1e3);
    let evaluate = |x: &[f64], _: f64| -> descent::Evaluation<LinalgError> {
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
            go = report(Progress {
                start: index,
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
