//! Estimate of the probability from the levels.

use crate::distribution::{normal_quantile, student_quantile};
use crate::statistics::wilson;

use super::chains::ChainState;

/// Results of one level.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The score at which the next level begins: zero in the last one.
    pub threshold: f64,
    /// Number of its states.
    pub states: usize,
    /// The share of states beyond the threshold.
    pub share: f64,
    /// The coefficient of variation of the share, including the correlation of the chains' states.
    pub variation: f64,
    /// The acceptance rate of the chains' steps; none in the first level, which has no chains.
    pub acceptance: Option<f64>,
    /// The scores of the states, in descending order.
    pub scores: Vec<f64>,
}

impl Level {
    /// `rows` are the steps of its chains, empty in the first level.
    pub(super) fn of(
        threshold: f64,
        states: &[ChainState],
        rows: &[Vec<ChainState>],
        beyond: impl Fn(&ChainState) -> bool,
    ) -> Level {
        let count = states.iter().filter(|state| beyond(state)).count();
        let share = count as f64 / states.len().max(1) as f64;
        let mut scores: Vec<f64> = states.iter().map(|state| state.score).collect();
        scores.sort_by(|a, b| b.total_cmp(a));
        let spread = (1.0 - share) / (share * states.len() as f64);
        let row = |row: &Vec<ChainState>| -> Vec<bool> { row.iter().map(&beyond).collect() };
        let rows: Vec<Vec<bool>> = rows.iter().map(row).collect();
        Level {
            threshold,
            states: states.len(),
            share,
            variation: (spread * (1.0 + inflation(&rows, share))).sqrt(),
            acceptance: None,
            scores,
        }
    }

    /// Adds the effect of each ancestor's descendants among the `states` on the logarithm of the share: the influence function.
    pub(super) fn add_influence(
        &self,
        states: &[ChainState],
        beyond: impl Fn(&ChainState) -> bool,
        influence: &mut [f64],
    ) {
        let count = self.share * states.len() as f64;
        if count > 0.0 {
            for state in states {
                influence[state.ancestor] += (f64::from(u8::from(beyond(state))) - self.share) / count;
            }
        }
    }

    /// The 95 % interval of its share, for a first level: its states are a plain random sample.
    fn proportion_interval(&self) -> [f64; 2] {
        let count = (self.share * self.states as f64).round() as usize;
        wilson(count, self.states).into()
    }

    /// Variance inflation of the states of its chains relative to independent ones.
    fn inflation(&self) -> f64 {
        let independent = (1.0 - self.share) / (self.share * self.states as f64);
        if independent > 0.0 {
            self.variation.powi(2) / independent
        } else {
            1.0
        }
    }
}

/// Increase of the variance due to the correlation of a chain's states: equations 27 to 29 of Au and Beck.
fn inflation(rows: &[Vec<bool>], share: f64) -> f64 {
    let variance = share * (1.0 - share);
    if rows.len() < 2 || variance <= 0.0 {
        return 0.0;
    }
    let length = rows.len();
    let lags = (1..length).map(|lag| {
        let pairs = (0..length - lag).flat_map(|at| rows[at].iter().zip(&rows[at + lag]));
        let (count, both) = pairs.fold((0, 0), |(count, both), (a, b)| {
            (count + 1, both + usize::from(*a && *b))
        });
        let covariance = both as f64 / f64::from(count) - share * share;
        (1.0 - lag as f64 / length as f64) * covariance / variance
    });
    // A negative value would mean that correlated states carry more information than independent ones.
    (2.0 * lags.sum::<f64>()).max(0.0)
}

/// The estimated probability and its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Probability of a score above zero; zero when no state of the last level has one.
    pub probability: f64,
    /// Its coefficient of variation: the larger of two estimates. That of Au and Beck includes the correlation within the chains, but
    /// none between chains or levels. The other treats the first level's states, each with all its descendants, as independent, and so
    /// includes every correlation, but few of them have descendants in the last level. Infinite when no event was found.
    pub variation: f64,
    /// Number of independent states of the first level to which the event's states go back: the inverse of the sum of the squared
    /// proportions of their descendants. Zero when no event was found.
    pub ancestors: f64,
    /// The 95 % interval: Student's distribution of the estimate's logarithm, with twice as many degrees of freedom as there are
    /// `ancestors`; Wilson's where the first level is the only one, because its states are independent; from zero to a bound when no
    /// event was found.
    pub interval: [f64; 2],
    /// Whether the thresholds stopped rising because the score takes few distinct values.
    pub stuck: bool,
    /// The levels.
    pub levels: Vec<Level>,
    /// Number of evaluated points.
    pub points: usize,
    /// Number of independent points that would give an equally narrow interval; infinite when no event was found.
    pub equivalent: f64,
    /// The mean of each coordinate over the states in the event, as standard normal numbers: shows which coordinates drive the event. Empty
    /// when no event was found.
    pub centre: Vec<f64>,
}

impl Estimate {
    pub(super) fn of(
        levels: &[Level],
        influence: &[f64],
        event: &[ChainState],
        points: usize,
        stuck: bool,
    ) -> Estimate {
        let probability: f64 = levels.iter().map(|level| level.share).product();
        let found = probability > 0.0;
        let chain_variance = levels.iter().map(|level| level.variation.powi(2)).sum::<f64>();
        let ancestry_variance = influence.iter().map(|x| x * x).sum::<f64>();
        let variation = chain_variance.max(ancestry_variance).sqrt();
        let ancestors = ancestors(event, influence.len());
        let coordinates = event.first().map_or(0, |state| state.z.len());
        let mean = |at: usize| event.iter().map(|state| state.z[at]).sum::<f64>() / event.len() as f64;
        Estimate {
            probability,
            variation: if found { variation } else { f64::INFINITY },
            ancestors,
            interval: match levels {
                [only] if found => only.proportion_interval(),
                _ if found => confidence_interval(probability, variation, ancestors),
                _ => [0.0, upper_bound(levels)],
            },
            stuck,
            levels: levels.to_vec(),
            points,
            equivalent: match levels {
                // Where every state is in the event, the formula is zero by zero.
                [only] if found => only.states as f64,
                _ if found => (1.0 - probability) / (probability * variation * variation),
                _ => f64::INFINITY,
            },
            centre: (0..coordinates).map(mean).collect(),
        }
    }

    /// Exceedance probability of each score encountered: ascending scores with descending probabilities.
    pub fn exceedance(&self) -> Vec<(f64, f64)> {
        let (mut curve, mut before) = (Vec::new(), 1.0);
        for level in &self.levels {
            let beyond = (level.share * level.states as f64).round() as usize;
            // The next level describes the region beyond the threshold more accurately.
            let last = std::ptr::eq(level, &self.levels[self.levels.len() - 1]);
            let from = if last { 0 } else { beyond };
            let own = level.scores.iter().enumerate().skip(from).rev();
            let part = |rank: usize| before * (rank as f64 + 0.5) / level.states as f64;
            curve.extend(own.map(|(rank, score)| (*score, part(rank))));
            before *= level.share;
        }
        curve
    }
}

/// Number of independent ancestors of the states, among `count`; zero for no states.
fn ancestors(states: &[ChainState], count: usize) -> f64 {
    let mut descendants = vec![0_usize; count];
    for state in states {
        descendants[state.ancestor] += 1;
    }
    let squares: f64 = descendants.iter().map(|own| (*own as f64).powi(2)).sum();
    if squares > 0.0 {
        (states.len() as f64).powi(2) / squares
    } else {
        0.0
    }
}

/// The degrees of freedom are twice the ancestors because the variation is computed from the states of all levels, and earlier levels have
/// more ancestors. The factor was found by experiment: see the test of the interval.
fn confidence_interval(probability: f64, variation: f64, ancestors: f64) -> [f64; 2] {
    let degrees_of_freedom = (2.0 * ancestors).floor().max(2.0) as usize;
    let width = student_quantile(0.975, degrees_of_freedom) * (variation * variation).ln_1p().sqrt();
    [probability * (-width).exp(), (probability * width.exp()).min(1.0)]
}

/// Upper bound of a probability with no observed event: 3 / N for N independent states (95 %), times an upper bound of the probability of
/// reaching the last level (95 %).
fn upper_bound(levels: &[Level]) -> f64 {
    let (last, before) = match levels.split_last() {
        Some(all) => all,
        None => return 1.0,
    };
    let share: f64 = before.iter().map(|level| level.share).product();
    let variation = before.iter().map(|level| level.variation.powi(2)).sum::<f64>();
    let most = share * (normal_quantile(0.95) * variation.ln_1p().sqrt()).exp();
    // Uses the variance inflation of the earlier levels: the correlation cannot be observed when no state is in the event.
    let inflation = before.iter().map(Level::inflation).fold(1.0, f64::max);
    (most * (3.0 * inflation / last.states.max(1) as f64).min(1.0)).min(1.0)
}
