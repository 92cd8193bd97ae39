//! What the levels tell.

use crate::distribution::normal_quantile;

use super::chains::State;

/// What is known of one level.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The score that the next level begins at: zero in the last one.
    pub threshold: f64,
    /// How many states it has.
    pub states: usize,
    /// The share of them that is beyond the threshold.
    pub share: f64,
    /// The coefficient of variation of the share, with the correlation of the chains' states.
    pub variation: f64,
    /// The part of the chains' steps that were accepted; none in the first level, which has no chains.
    pub acceptance: Option<f64>,
    /// The scores of the states, falling.
    pub scores: Vec<f64>,
}

impl Level {
    /// `rows` are the steps of its chains, without any in the first level.
    pub(super) fn of(threshold: f64, states: &[State], rows: &[Vec<State>], beyond: impl Fn(&State) -> bool) -> Level {
        let count = states.iter().filter(|state| beyond(state)).count();
        let share = count as f64 / states.len().max(1) as f64;
        let mut scores: Vec<f64> = states.iter().map(|state| state.score).collect();
        scores.sort_by(|a, b| b.total_cmp(a));
        let spread = (1.0 - share) / (share * states.len() as f64);
        let row = |row: &Vec<State>| -> Vec<bool> { row.iter().map(&beyond).collect() };
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

    /// By how much the states of its chains say less than independent ones.
    fn inflation(&self) -> f64 {
        let independent = (1.0 - self.share) / (self.share * self.states as f64);
        if independent > 0.0 {
            self.variation.powi(2) / independent
        } else {
            1.0
        }
    }
}

/// By how much the correlation of the states of a chain enlarges the variance: equations 27 to 29 of Au and Beck.
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
    // A negative one would say that correlated states know more than independent ones.
    (2.0 * lags.sum::<f64>()).max(0.0)
}

/// The probability, and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Of a score above zero; zero where no state of the last level has one.
    pub probability: f64,
    /// Its coefficient of variation, of independent levels. They are not quite that, so it is a little too small. Infinite where nothing was
    /// found.
    pub variation: f64,
    /// The 95 % interval, of a logarithm that is normal; from zero to a bound where nothing was found.
    pub interval: [f64; 2],
    /// Whether the levels stopped to rise, because the score takes few different values.
    pub stuck: bool,
    /// The levels.
    pub levels: Vec<Level>,
    /// How many points were evaluated.
    pub points: usize,
    /// How many independent points would give an interval as narrow; infinite where nothing was found.
    pub equivalent: f64,
    /// The mean of each coordinate over the states in the event, as standard normal numbers: what the event has to do with. Empty where
    /// nothing was found.
    pub centre: Vec<f64>,
}

impl Estimate {
    pub(super) fn of(levels: &[Level], event: &[State], points: usize, stuck: bool) -> Estimate {
        let probability: f64 = levels.iter().map(|level| level.share).product();
        let found = probability > 0.0;
        let variation = levels.iter().map(|level| level.variation.powi(2)).sum::<f64>().sqrt();
        let coordinates = event.first().map_or(0, |state| state.z.len());
        let mean = |at: usize| event.iter().map(|state| state.z[at]).sum::<f64>() / event.len() as f64;
        Estimate {
            probability,
            variation: if found { variation } else { f64::INFINITY },
            interval: if found {
                around(probability, variation)
            } else {
                [0.0, bound(levels)]
            },
            stuck,
            levels: levels.to_vec(),
            points,
            equivalent: if found {
                (1.0 - probability) / (probability * variation * variation)
            } else {
                f64::INFINITY
            },
            centre: (0..coordinates).map(mean).collect(),
        }
    }

    /// How often a score is greater than each of those that were met on the way: rising scores with falling probabilities.
    pub fn exceedance(&self) -> Vec<(f64, f64)> {
        let (mut curve, mut before) = (Vec::new(), 1.0);
        for level in &self.levels {
            let beyond = (level.share * level.states as f64).round() as usize;
            // What is beyond the threshold is told better by the next level.
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

fn around(probability: f64, variation: f64) -> [f64; 2] {
    let width = normal_quantile(0.975) * (variation * variation).ln_1p().sqrt();
    [probability * (-width).exp(), (probability * width.exp()).min(1.0)]
}

/// What a probability hardly exceeds of which nothing was seen: with N independent states 3 / N (95 %), of as much as the levels before may
/// well have kept (95 %).
fn bound(levels: &[Level]) -> f64 {
    let (last, before) = match levels.split_last() {
        Some(all) => all,
        None => return 1.0,
    };
    let share: f64 = before.iter().map(|level| level.share).product();
    let variation = before.iter().map(|level| level.variation.powi(2)).sum::<f64>();
    let most = share * (normal_quantile(0.95) * variation.ln_1p().sqrt()).exp();
    // Of states that say so little as those of the levels before: what correlates them does not show where none is in the event.
    let inflation = before.iter().map(Level::inflation).fold(1.0, f64::max);
    (most * (3.0 * inflation / last.states.max(1) as f64).min(1.0)).min(1.0)
}
