//! Tuning problem: models, channels and gains; validated before the run.

use std::ops::Range;

use super::gain_units::GainUnits;
use super::gains::{GainBlock, GainError, Parametrised, Part};
use crate::linalg::{LinalgError, Matrix, c64};
use crate::state_space::StateSpace;

/// One closed-loop transfer matrix with an H-infinity norm to be minimised.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name, for reports.
    pub name: String,
    /// Range of the plant's performance outputs z.
    pub outputs: Range<usize>,
    /// Range of the plant's exogenous inputs w.
    pub inputs: Range<usize>,
}

/// A plant for which the gains are tuned, weights included: inputs [w; u], outputs [z; y], closed by `u = K y`.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Name, for reports.
    pub name: String,
    /// The generalised plant.
    pub plant: StateSpace,
    /// Number of control inputs u: the last inputs of `plant`.
    pub controls: usize,
    /// Number of measurements y: the last outputs of `plant`.
    pub measurements: usize,
    /// Transfer matrices in the objective.
    pub channels: Vec<Channel>,
    /// Per gain block, the transforms `left` and `right` of this model; `None` is the identity.
    pub transforms: Vec<Option<(Matrix, Matrix)>>,
}

/// A complete tuning problem: the largest channel norm over all models is minimised over the gains.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Models tuned for simultaneously.
    pub models: Vec<Model>,
    /// Tunable blocks; the entries of K outside them are zero.
    pub gains: Vec<GainBlock>,
}

/// Errors of a tuning problem or of tuning.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TuneError {
    /// There is no gain to tune, or no model to tune for.
    #[error("the problem has no {0}")]
    Empty(&'static str),
    /// A range or a transform does not fit the plant.
    #[error("model {model}: {what}")]
    Misfit {
        /// Name of the model.
        model: String,
        /// What does not fit.
        what: String,
    },
    /// A gain block is invalid.
    #[error(transparent)]
    Gain(#[from] GainError),
    /// No controller can stabilise the plant.
    #[error("model {model}: the plant cannot be stabilised: the mode at {mode} is not moved by any control input")]
    NotStabilisable {
        /// Name of the model.
        model: String,
        /// The mode.
        mode: c64,
    },
    /// No controller can stabilise the plant from these measurements.
    #[error("model {model}: the plant cannot be stabilised: the mode at {mode} is not seen by any measurement")]
    NotDetectable {
        /// Name of the model.
        model: String,
        /// The mode.
        mode: c64,
    },
    /// The stabilisation phase found no stabilising gain.
    #[error("no stabilising gain found in {starts} starts; the least spectral abscissa reached is {abscissa:.6e}")]
    NotStabilised {
        /// Starts tried.
        starts: usize,
        /// The least spectral abscissa over all models that was reached.
        abscissa: f64,
        /// The parameters there.
        parameters: Vec<f64>,
    },
    /// The caller asked to stop before any stabilising gain was found.
    #[error("stopped before a stabilising gain was found; the least spectral abscissa reached is {0:.6e}")]
    Stopped(f64),
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// A problem that passed validation.
#[derive(Debug, Clone)]
pub(crate) struct ValidatedProblem {
    pub(crate) models: Vec<Model>,
    pub(crate) gains: Vec<Parametrised>,
    /// Units in which the feedback of each model is measured.
    pub(crate) gain_units: Vec<GainUnits>,
    /// The size of the fastest pole of each model without feedback.
    pub(crate) fastest: Vec<f64>,
}

impl ValidatedProblem {
    pub(crate) fn new(problem: &Problem) -> Result<Self, TuneError> {
        if problem.models.is_empty() {
            return Err(TuneError::Empty("model"));
        }
        let gains = problem
            .gains
            .iter()
            .cloned()
            .map(Parametrised::new)
            .collect::<Result<Vec<_>, _>>()?;
        if gains.iter().map(|g| g.block.kind.parameters()).sum::<usize>() == 0 {
            return Err(TuneError::Empty("tunable gain"));
        }
        let mut models = problem.models.clone();
        for model in &mut models {
            check_model(model, &problem.gains)?;
            // Scaling of the states changes no transfer function and improves every eigenvalue computation.
            model.plant = model.plant.balanced();
            let n = model.plant.states();
            let (inputs, outputs) = (model.plant.inputs(), model.plant.outputs());
            let loop_part = StateSpace {
                a: model.plant.a.clone(),
                b: model.plant.b.block(0, inputs - model.controls, n, model.controls),
                c: model
                    .plant
                    .c
                    .block(outputs - model.measurements, 0, model.measurements, n),
                d: Matrix::zeros(model.measurements, model.controls),
            };
            if let Some(&mode) = loop_part.fixed_unstable_modes(true)?.first() {
                return Err(TuneError::NotStabilisable {
                    model: model.name.clone(),
                    mode,
                });
            }
            if let Some(&mode) = loop_part.fixed_unstable_modes(false)?.first() {
                return Err(TuneError::NotDetectable {
                    model: model.name.clone(),
                    mode,
                });
            }
        }
        let gain_units = models
            .iter()
            .map(|model| GainUnits::new(&model.plant, model.controls, model.measurements))
            .collect();
        let fastest = models
            .iter()
            .map(|m| Ok(m.plant.poles()?.iter().map(|p| p.norm()).fold(0.0, f64::max)))
            .collect::<Result<_, LinalgError>>()?;
        Ok(Self {
            models,
            gains,
            gain_units,
            fastest,
        })
    }

    /// Number of free parameters.
    pub(crate) fn parameters(&self) -> usize {
        self.gains.iter().map(|g| g.block.kind.parameters()).sum()
    }

    /// The gain blocks X at `x`.
    pub(crate) fn blocks(&self, x: &[f64]) -> Vec<Matrix> {
        let mut at = 0;
        self.gains
            .iter()
            .map(|g| {
                let n = g.block.kind.parameters();
                at += n;
                g.value(&x[at - n..at])
            })
            .collect()
    }

    /// The parts of the gains whose size can be changed alone: all gains together (no block), then those of each block.
    pub(crate) fn parts(&self) -> Vec<(Option<usize>, Part)> {
        let blocks = self.gains.iter().enumerate();
        let own = blocks.flat_map(|(block, g)| g.parts().into_iter().map(move |part| (Some(block), part)));
        std::iter::once((None, Part::All)).chain(own).collect()
    }

    /// The parameters `x` with a part of the gains multiplied by `factor`.
    pub(crate) fn scaled(&self, x: &[f64], (block, part): (Option<usize>, Part), factor: f64) -> Vec<f64> {
        let mut scaled = x.to_vec();
        let mut at = 0;
        for (own, g) in self.gains.iter().enumerate() {
            let n = g.block.kind.parameters();
            if block.is_none_or(|block| block == own) {
                g.scale(&mut scaled[at..at + n], part, factor);
            }
            at += n;
        }
        scaled
    }

    /// The controller gain matrix of one model from the blocks.
    pub(crate) fn gain(&self, model: &Model, blocks: &[Matrix]) -> Matrix {
        let mut k = Matrix::zeros(model.controls, model.measurements);
        for ((g, x), transform) in self.gains.iter().zip(blocks).zip(&model.transforms) {
            let placed = match transform {
                Some((left, right)) => left * x * right,
                None => x.clone(),
            };
            for j in 0..placed.ncols() {
                for i in 0..placed.nrows() {
                    k[(g.block.row + i, g.block.column + j)] += placed[(i, j)];
                }
            }
        }
        k
    }

    /// Maps the gradient `in_k` of a function in one model's gain matrix to the gradient in x.
    pub(crate) fn pull_back(&self, model: &Model, x: &[f64], in_k: &Matrix) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        let mut at = 0;
        for (g, transform) in self.gains.iter().zip(&model.transforms) {
            let n = g.block.kind.parameters();
            let (rows, columns) = match transform {
                Some((left, right)) => (left.nrows(), right.ncols()),
                None => g.block.kind.shape(),
            };
            let part = in_k.block(g.block.row, g.block.column, rows, columns);
            let in_x = match transform {
                Some((left, right)) => left.transpose() * part * right.transpose(),
                None => part,
            };
            g.pull_back(&x[at..at + n], &in_x, &mut out[at..at + n]);
            at += n;
        }
        out
    }
}

fn check_model(model: &Model, gains: &[GainBlock]) -> Result<(), TuneError> {
    let misfit = |what: String| {
        Err(TuneError::Misfit {
            model: model.name.clone(),
            what,
        })
    };
    let (inputs, outputs) = (model.plant.inputs(), model.plant.outputs());
    if model.controls == 0 || model.controls > inputs {
        return misfit(format!("{} control inputs of {inputs} inputs", model.controls));
    }
    if model.measurements == 0 || model.measurements > outputs {
        return misfit(format!("{} measurements of {outputs} outputs", model.measurements));
    }
    if model.channels.is_empty() {
        return misfit("no channel".into());
    }
    let (nw, nz) = (inputs - model.controls, outputs - model.measurements);
    for c in &model.channels {
        let fits = |r: &Range<usize>, n| !r.is_empty() && r.end <= n;
        if !fits(&c.outputs, nz) || !fits(&c.inputs, nw) {
            return misfit(format!(
                "channel {} takes outputs {:?} of {nz} and inputs {:?} of {nw}",
                c.name, c.outputs, c.inputs
            ));
        }
    }
    if model.transforms.len() != gains.len() {
        return misfit(format!(
            "{} transforms for {} gains",
            model.transforms.len(),
            gains.len()
        ));
    }
    for (g, t) in gains.iter().zip(&model.transforms) {
        let (p, q) = g.kind.shape();
        let (rows, columns) = match t {
            Some((left, right)) if left.ncols() != p || right.nrows() != q => {
                return misfit(format!(
                    "the transforms of gain {} do not fit its {p} x {q} shape",
                    g.name
                ));
            }
            Some((left, right)) => (left.nrows(), right.ncols()),
            None => (p, q),
        };
        if g.row + rows > model.controls || g.column + columns > model.measurements {
            return misfit(format!(
                "gain {} reaches row {} and column {} of a {} x {} controller",
                g.name,
                g.row + rows,
                g.column + columns,
                model.controls,
                model.measurements
            ));
        }
    }
    Ok(())
}
