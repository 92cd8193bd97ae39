//! Whether an optimum lies at infinite gain: gains far smaller than those found do as well.

use super::growth_penalty;
use super::objective::Objective;
use super::options::Options;
use super::problem::ValidatedProblem;
use super::search::Search;
use crate::linalg::LinalgError;

/// Feedback, in multiples of the plant, above which it may be diverging.
pub(super) const DIVERGING_FEEDBACK: f64 = 30.0;
/// A higher penalty on growing gains than that of the search, which decides doubtful cases.
const TRIAL_WEIGHT: f64 = 100.0 * growth_penalty::WEIGHT;
/// Gains that are this much worse, relative to gamma, do as well.
const AS_GOOD: f64 = 1e-4;

/// Factors on gains: gamma that is no lower behind an optimum at a finite gain rises here at the latest.
const LARGER: [f64; 2] = [3.0, 30.0];

/// Whether the gains at `x`, with this gamma, are limited by the growth penalty alone: less than half of them does as well to a part
/// in ten thousand, and gamma does not rise behind them. An optimum at a finite gain may be flat before it, but not behind it.
pub(super) fn diverges(
    checked: &ValidatedProblem,
    options: &Options,
    x: &[f64],
    gamma: f64,
) -> Result<bool, LinalgError> {
    let feedback = growth_penalty::feedback(checked, x);
    if feedback < DIVERGING_FEEDBACK {
        return Ok(false);
    }
    if feedback >= 0.1 * growth_penalty::FEEDBACK_MAX {
        return Ok(true);
    }
    let mut evaluation = Comparison {
        objective: Objective::new(checked, 1e-7, options.threads),
        gamma,
    };
    if flat_in_size(checked, &mut evaluation, x)? {
        return Ok(true);
    }
    let search = Search {
        checked,
        options,
        index: 0,
        threads: options.threads,
        report: &|_| true,
    };
    let mut trial = x.to_vec();
    let mut objective = Objective::new(checked, 1e-7, options.threads);
    search.improve(&mut objective, &mut trial, TRIAL_WEIGHT)?;
    if growth_penalty::feedback(checked, &trial) >= 0.5 * feedback {
        return Ok(false);
    }
    // The way back to `x`, continued. It need not be straight, so it is not continued far.
    let behind: Vec<f64> = x.iter().zip(&trial).map(|(x, t)| t + LARGER[0] * (x - t)).collect();
    evaluation.falls_towards(&behind)
}

/// Compares gains with those that were found.
struct Comparison<'a> {
    objective: Objective<'a>,
    /// Gamma of those.
    gamma: f64,
}

impl Comparison<'_> {
    /// Whether gamma at `x` is above that of the gains found by less than this fraction.
    fn within(&mut self, x: &[f64], fraction: f64) -> Result<bool, LinalgError> {
        let (value, _) = self.objective.loop_norms(x, self.gamma * (1.0 + 2.0 * AS_GOOD))?;
        Ok(value.gamma <= self.gamma * (1.0 + fraction))
    }

    /// Whether gamma does not rise from the gains found to `x`, by more than the growth penalty.
    fn falls_towards(&mut self, x: &[f64]) -> Result<bool, LinalgError> {
        self.within(x, growth_penalty::WEIGHT)
    }
}

/// Whether gamma hardly depends on the size of all gains, of one block, or of a row, a column or an entry of a free block. In gains of a
/// million its gradient is too small for a search to walk back.
fn flat_in_size(checked: &ValidatedProblem, evaluation: &mut Comparison<'_>, x: &[f64]) -> Result<bool, LinalgError> {
    /// Factors on the gains; the smaller ones may not stabilise where the larger ones do.
    const SMALLER: [f64; 3] = [0.4, 0.1, 0.01];
    let feedback = growth_penalty::feedback(checked, x);
    for part in checked.parts() {
        let scaled = |factor: f64| checked.scaled(x, part, factor);
        let mut flat = false;
        for factor in SMALLER {
            let smaller = scaled(factor);
            flat |=
                growth_penalty::feedback(checked, &smaller) < 0.5 * feedback && evaluation.within(&smaller, AS_GOOD)?;
        }
        if flat && evaluation.falls_towards(&scaled(LARGER[0]))? && evaluation.falls_towards(&scaled(LARGER[1]))? {
            return Ok(true);
        }
    }
    Ok(false)
}
