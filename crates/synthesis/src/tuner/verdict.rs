//! Assessment of a result: norms free of rounding error, and whether an optimum was attained.

use super::divergence::{DIVERGING_FEEDBACK, diverges};
use super::growth_penalty;
use super::objective::{ChannelNorm, Objective, ObjectiveValue};
use super::options::Options;
use super::problem::{Channel, Model, ValidatedProblem};
use crate::double_double::Loop;
use crate::interconnect;
use crate::linalg::{LinalgError, Matrix, c64};
use crate::norm;
use crate::reduce;
use crate::state_space::StateSpace;

/// Whether the gains found are an optimum, or only the edge of the search region.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// A local optimum among the gains that were searched.
    Attained,
    /// The infimum lies at infinite gain: gamma was still falling where the feedback is this many times as large as the plant.
    InfiniteGain {
        /// Name of the model.
        model: String,
        /// How many times as large as the plant the feedback is.
        feedback: f64,
    },
    /// The infimum lies on the limit of stability: gamma was still falling as a pole approached the imaginary axis.
    PoleNearAxis {
        /// Name of the model.
        model: String,
        /// The pole of the closed loop.
        pole: c64,
    },
    /// No channel passes anything from w to z, with these gains or others: there was nothing to minimise.
    NothingToMinimise,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Attained => write!(f, "a local optimum"),
            Self::InfiniteGain { model, feedback } => write!(
                f,
                "model {model}: no optimum: gamma still falls with growing gains, where the feedback is {feedback:.1e} times as \
                 large as the plant; add an effort weight (rows of D12) or a measurement noise (columns of D21)"
            ),
            Self::PoleNearAxis { model, pole } => write!(
                f,
                "model {model}: no optimum: gamma still falls as a pole approaches the imaginary axis, it is at {pole:.3e}; weight \
                 the slow motion (rows of C1) or disturb it (columns of B1)"
            ),
            Self::NothingToMinimise => write!(
                f,
                "w does not reach z: gamma is zero whatever the gains; check B1, C1, D11, D12 and D21"
            ),
        }
    }
}

/// A pole this near to the axis, relative to the fastest one, is only there because the axis is better.
const NEAR_AXIS: f64 = 1e-6;
/// Poles that span more than this leave the slow ones with few correct digits.
const POLE_SPREAD: f64 = 1e5;

impl Verdict {
    /// The verdict on the gains at `x`, which stabilise.
    pub(super) fn of(
        checked: &ValidatedProblem,
        options: &Options,
        x: &[f64],
        value: &ObjectiveValue,
    ) -> Result<Self, LinalgError> {
        if value.gamma == 0.0 {
            // Gains that cancel every path from w to z attain the least gamma there is.
            return Ok(if cancels(checked, options, x)? {
                Self::Attained
            } else {
                Self::NothingToMinimise
            });
        }
        let blocks = checked.blocks(x);
        if diverges(checked, options, x, value.gamma)? {
            let sizes = checked.models.iter().zip(&checked.gain_units);
            let sizes = sizes.map(|(model, units)| (units.feedback(&checked.gain(model, &blocks)), model));
            if let Some((feedback, model)) = sizes.max_by(|a, b| a.0.total_cmp(&b.0)) {
                let model = model.name.clone();
                return Ok(Self::InfiniteGain { model, feedback });
            }
        }
        for (model, own) in checked.models.iter().zip(&checked.fastest) {
            let k = checked.gain(model, &blocks);
            // The poles of the weights do not depend on the gains; only those of the loop are moved by the search.
            let poles = loop_poles(model, &k)?;
            let fastest = poles.iter().map(|p| p.norm()).fold(*own, f64::max);
            let slowest = poles.into_iter().max_by(|a, b| a.re.total_cmp(&b.re));
            if let Some(pole) = slowest.filter(|p| p.re > -NEAR_AXIS * fastest) {
                let model = model.name.clone();
                // A slow pole that is no slower than the plant has not moved: the fast ones have run away from it.
                let feedback = growth_penalty::feedback(checked, x);
                return Ok(if feedback >= DIVERGING_FEEDBACK && pole.re <= -NEAR_AXIS * own {
                    Self::InfiniteGain { model, feedback }
                } else {
                    Self::PoleNearAxis { model, pole }
                });
            }
        }
        Ok(Self::Attained)
    }
}

/// Whether gamma is zero because of the gains at `x`, and not whatever they are: it is above zero for gains nearby that stabilise
/// too. Zeros of the structure stay exactly zero when the gains change.
fn cancels(checked: &ValidatedProblem, options: &Options, x: &[f64]) -> Result<bool, LinalgError> {
    /// Steps relative to the largest gain; the larger ones may not stabilise, and the effect of the smaller ones may be lost.
    const STEPS: [f64; 4] = [1e-1, 1e-2, 1e-4, 1e-6];
    let size = x.iter().fold(0.0, |size: f64, gain| size.max(gain.abs()));
    let size = if size > 0.0 { size } else { 1.0 };
    let mut objective = Objective::new(checked, 1e-7, options.threads);
    for step in STEPS {
        for index in 0..x.len() {
            for sign in [1.0, -1.0] {
                let mut near = x.to_vec();
                near[index] += sign * step * size;
                let (value, _) = objective.loop_norms(&near, f64::INFINITY)?;
                if value.gamma > 0.0 && value.gamma.is_finite() {
                    return Ok(true);
                }
            }
        }
    }
    Ok(false)
}

/// The poles of the part of a model that lies on a path from u to y, closed.
fn loop_poles(model: &Model, k: &Matrix) -> Result<Vec<c64>, LinalgError> {
    let p = &model.plant;
    let (nw, nz) = (p.inputs() - model.controls, p.outputs() - model.measurements);
    let part = reduce::without_unconnected_states(&p.select(nz..p.outputs(), nw..p.inputs()));
    match interconnect::lft_lower(&part, &StateSpace::gain(k.clone())) {
        Ok(closed) => closed.poles(),
        Err(_) => Ok(Vec::new()),
    }
}

impl Objective<'_> {
    /// The reported norms: no channel skipped, and where the poles of a model span many decades, every peak is also searched
    /// on a grid and evaluated in double-double arithmetic.
    pub(super) fn reported(&mut self, x: &[f64]) -> Result<ObjectiveValue, LinalgError> {
        let screen = std::mem::replace(&mut self.screen, 0.0);
        let result = self.loop_norms(x, f64::INFINITY);
        self.screen = screen;
        let (mut value, loops) = result?;
        if value.gamma.is_infinite() {
            return Ok(value);
        }
        let blocks = self.problem.blocks(x);
        for ((model, entry), norms) in self.problem.models.iter().zip(&loops).zip(&mut value.channels) {
            let sizes = || entry.closed.poles.iter().map(|p| p.norm());
            let (slowest, fastest) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
            if fastest <= POLE_SPREAD * slowest {
                continue;
            }
            let k = self.problem.gain(model, &blocks);
            let closed = Loop {
                plant: &model.plant,
                k: &k,
            };
            for ((channel, part), found) in model.channels.iter().zip(&entry.parts).zip(norms) {
                *found = refine_peaks(&closed, channel, part, *found, &entry.closed.poles)?;
            }
        }
        value.gamma = value.channels.iter().flatten().map(|n| n.gain).fold(0.0, f64::max);
        Ok(value)
    }
}

/// The largest gain of a channel: the highest points of a logarithmic grid and of the resonances, each refined by golden
/// sections in double-double arithmetic.
fn refine_peaks(
    closed: &Loop<'_>,
    channel: &Channel,
    part: &StateSpace,
    found: ChannelNorm,
    poles: &[c64],
) -> Result<ChannelNorm, LinalgError> {
    const PER_DECADE: f64 = 16.0;
    const GOLDEN: f64 = 0.381_966_011_250_105;
    let gain = |omega: f64| closed.gain(&channel.outputs, &channel.inputs, omega);
    let guesses = norm::peak_guesses(poles);
    let mut grid = guesses.clone();
    if let (Some(low), Some(high)) = (guesses.iter().find(|w| **w > 0.0), guesses.last()) {
        let (low, high) = (1e-2 * low, 1e2 * high);
        let steps = (PER_DECADE * libm::log10(high / low)).ceil();
        grid.extend((0..=steps as usize).map(|i| low * libm::pow(high / low, i as f64 / steps)));
    }
    grid.extend((found.omega > 0.0 && found.omega.is_finite()).then_some(found.omega));
    grid.sort_by(f64::total_cmp);
    let gains = grid
        .iter()
        .map(|&w| norm::gain_at(part, w))
        .collect::<Result<Vec<_>, _>>()?;
    let mut tops: Vec<usize> = (0..grid.len())
        .filter(|&i| (i == 0 || gains[i] >= gains[i - 1]) && gains.get(i + 1).is_none_or(|right| gains[i] >= *right))
        .collect();
    tops.sort_by(|&i, &j| gains[j].total_cmp(&gains[i]));
    let mut best = ChannelNorm {
        gain: gain(0.0)?,
        omega: 0.0,
    };
    let mut update_best = |omega: f64, gain: f64| {
        if gain > best.gain {
            best = ChannelNorm { gain, omega };
        }
    };
    update_best(f64::INFINITY, gain(f64::INFINITY)?);
    if found.omega.is_finite() {
        update_best(found.omega, gain(found.omega)?);
    }
    for at in tops.into_iter().take(4) {
        let mut low = grid[at.saturating_sub(1)];
        let mut high = grid[(at + 1).min(grid.len() - 1)];
        let (mut peak, mut top) = (grid[at], gain(grid[at])?);
        update_best(peak, top);
        while high - low > 1e-7 * high {
            let left = peak - low > high - peak;
            let trial = if left {
                peak - GOLDEN * (peak - low)
            } else {
                peak + GOLDEN * (high - peak)
            };
            let trial_gain = gain(trial)?;
            match (trial_gain > top, left) {
                (true, true) => (high, top, peak) = (peak, trial_gain, trial),
                (true, false) => (low, top, peak) = (peak, trial_gain, trial),
                (false, true) => low = trial,
                (false, false) => high = trial,
            }
        }
        update_best(peak, top);
    }
    Ok(best)
}
