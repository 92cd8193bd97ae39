//! Subset simulation: the probability of an event too rare for direct Monte Carlo.
//!
//! Siu-Kui Au and James Beck, *Estimation of small failure probabilities in high dimensions by subset simulation*, Probabilistic Engineering
//! Mechanics 16 (2001) 263-277. The probability that a score exceeds zero is a product of larger ones: that it exceeds the first threshold,
//! that it exceeds the second one given that it exceeds the first, and so on. Each threshold is the score that a given share of the
//! level's states exceeds, and the next level's states are generated from those by Markov chains with the steps of *conditional
//! sampling* (Papaioannou, Betz, Zwirglmaier and Straub, *MCMC algorithms for subset simulation*, Probabilistic Engineering Mechanics 41
//! (2015) 89-103) in the space of independent standard normal numbers.
//!
//! ```
//! use sampling::design::Coordinate;
//! use sampling::distribution::normal_quantile;
//! use sampling::subset::{Settings, Subset};
//!
//! // How often does a standard normal number exceed 4? 3.17e-5 of all times.
//! let mut subset = Subset::new(Settings::default(), 1, vec![Coordinate::random(1, "x")])?;
//! while let Some(batch) = subset.batch() {
//!     let scores: Vec<f64> = batch.iter().map(|one| normal_quantile(one.u[0]) - 4.0).collect();
//!     subset.submit_scores(&scores);
//! }
//! let estimate = subset.estimate();
//! assert!((1e-5..1e-4).contains(&estimate.probability));
//! # Ok::<(), sampling::distribution::InvalidParameter>(())
//! ```
//!
//! The module does not evaluate scores: it returns a batch of points and takes their scores, and the next batch is a function of all scores
//! so far, of the seed, and of the names of the coordinates. So an interrupted calculation can be resumed from its scores alone.

mod candidate;
mod chains;
mod estimate;

pub use candidate::Candidate;
pub use estimate::{Estimate, Level};

use crate::design::Coordinate;
use crate::distribution::{InvalidParameter, normal_quantile};
use chains::{ChainState, Chains};

/// Settings of a subset simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Number of states per level.
    pub points: usize,
    /// The share of a level's states beyond its threshold: one over an integer.
    pub share: f64,
    /// Maximum number of levels: the event is reached with fewer, or it is rarer than `share` to this power.
    pub levels: usize,
}

impl Default for Settings {
    /// 1000 states, a share of a tenth, eight levels: down to a probability of 1e-8.
    fn default() -> Settings {
        Settings {
            points: 1000,
            share: 0.1,
            levels: 8,
        }
    }
}

/// A subset simulation in progress.
#[derive(Debug)]
pub struct Subset {
    settings: Settings,
    coordinates: Vec<Coordinate>,
    /// Selects chain seeds at random when more states are beyond a threshold than there are chains.
    seed_choice: Coordinate,
    batch: Vec<Candidate>,
    /// Number of points issued before the current batch.
    issued: usize,
    /// The chains of the current level; none in the first level and at the end.
    chains: Option<Chains>,
    levels: Vec<Level>,
    /// The effect of each state of the first level, through all its descendants, on the logarithm of the probability.
    influence: Vec<f64>,
    /// The states in the event.
    event: Vec<ChainState>,
    /// Whether the thresholds stopped rising.
    stuck: bool,
}

impl Subset {
    /// Begins with one coordinate per dimension of a point. Points of the first level are taken from the coordinates directly.
    ///
    /// # Errors
    /// Invalid settings.
    pub fn new(settings: Settings, seed: u64, coordinates: Vec<Coordinate>) -> Result<Subset, InvalidParameter> {
        let wrong = |parameter, reason: String| Err(InvalidParameter { parameter, reason });
        let length = 1.0 / settings.share;
        if !(settings.share > 0.0 && settings.share <= 0.5) || (length - length.round()).abs() > 1e-9 {
            return wrong(
                "share",
                format!(
                    "{} is not one over a whole number from 2 on, such as 0.1",
                    settings.share
                ),
            );
        }
        let length = length.round() as usize;
        if settings.points < 10 * length || !settings.points.is_multiple_of(length) {
            return wrong(
                "points",
                format!(
                    "{} cannot be divided into chains of {length}, of which there are at least 10: take a multiple of {length} from {} on",
                    settings.points,
                    10 * length
                ),
            );
        }
        if settings.levels == 0 {
            return wrong("levels", "0 are none".to_owned());
        }
        if coordinates.is_empty() {
            return wrong("", "nothing is drawn".to_owned());
        }
        let batch = (0..settings.points).map(|number| Candidate {
            number,
            level: 0,
            parent: None,
            u: coordinates.iter().map(|one| one.at(number as u64)).collect(),
        });
        Ok(Subset {
            batch: batch.collect(),
            issued: 0,
            settings,
            seed_choice: Coordinate::random(seed, "subset lots"),
            coordinates,
            chains: None,
            levels: Vec::new(),
            influence: vec![0.0; settings.points],
            event: Vec::new(),
            stuck: false,
        })
    }

    /// The points to be evaluated; `None` at the end.
    pub fn batch(&self) -> Option<&[Candidate]> {
        (!self.batch.is_empty()).then_some(&self.batch)
    }

    /// Takes the scores of the batch, in its order: above zero, infinity included, is the event. NaN marks an impossible point.
    ///
    /// # Panics
    /// When there are not as many scores as points in the batch.
    pub fn submit_scores(&mut self, scores: &[f64]) {
        assert_eq!(scores.len(), self.batch.len(), "a score for each point of the batch");
        let batch = std::mem::take(&mut self.batch);
        self.issued += batch.len();
        let evaluated = batch.into_iter().zip(scores).map(|(one, score)| ChainState {
            number: one.number,
            ancestor: one.number,
            z: one.u.iter().map(|u| normal_quantile(*u)).collect(),
            score: *score,
        });
        match self.chains.take() {
            None => {
                let states: Vec<ChainState> = evaluated.filter(|state| !state.score.is_nan()).collect();
                self.finish_level(states, Vec::new(), 1.0);
            }
            Some(mut chains) => {
                chains.step(evaluated);
                if chains.is_complete() {
                    let (acceptance, deviation) = (chains.acceptance(), chains.deviation());
                    let rows = chains.into_rows();
                    let states = rows.concat();
                    self.finish_level(states, rows, deviation);
                    if let Some(level) = self.levels.last_mut() {
                        level.acceptance = Some(acceptance);
                    }
                } else {
                    self.batch = chains.propose(&self.coordinates, self.issued, self.levels.len());
                    self.chains = Some(chains);
                }
            }
        }
    }

    /// The estimate so far.
    pub fn estimate(&self) -> Estimate {
        Estimate::of(&self.levels, &self.influence, &self.event, self.issued, self.stuck)
    }

    /// Ends a level and begins the next one, if needed. `rows` are the steps of its chains, and `deviation` their standard deviation.
    fn finish_level(&mut self, states: Vec<ChainState>, rows: Vec<Vec<ChainState>>, deviation: f64) {
        let mut sorted: Vec<f64> = states.iter().map(|state| state.score).collect();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let count = (self.settings.points as f64 * self.settings.share).round() as usize;
        // The score of the last state that continues: states with the same score continue too.
        let reached = sorted.get(count - 1).copied().unwrap_or(f64::NEG_INFINITY);
        // When the score takes few distinct values, a level's threshold may equal the previous one's.
        let before = self.levels.last().map_or(f64::NEG_INFINITY, |level| level.threshold);
        self.stuck = reached <= 0.0 && (reached <= before || sorted.last().is_some_and(|least| *least >= reached));
        let last = reached > 0.0 || self.stuck || self.levels.len() + 1 >= self.settings.levels;
        let threshold = if last { 0.0 } else { reached };
        let beyond = |state: &ChainState| {
            if last {
                state.score > 0.0
            } else {
                state.score >= threshold
            }
        };
        let level = Level::of(threshold, &states, &rows, beyond);
        level.add_influence(&states, beyond, &mut self.influence);
        self.levels.push(level);
        if last {
            self.event = states.into_iter().filter(beyond).collect();
            return;
        }
        let deviation = match self.levels.len() {
            1 => chains::FIRST_DEVIATION,
            _ => deviation,
        };
        let seeds: Vec<ChainState> = states.into_iter().filter(|state| state.score >= threshold).collect();
        let seeds = chains::select_seeds(seeds, count, &self.seed_choice);
        let length = (1.0 / self.settings.share).round() as usize;
        let chains = Chains::new(seeds, length, threshold, deviation);
        self.batch = chains.propose(&self.coordinates, self.issued, self.levels.len());
        self.chains = Some(chains);
    }
}
