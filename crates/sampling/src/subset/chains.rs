//! The Markov chains of a level, all stepped together.

use crate::design::{Coordinate, clamp_open};
use crate::distribution::{normal_cumulative, normal_quantile};

use super::candidate::Candidate;

/// The standard deviation of the first level's steps.
pub(super) const FIRST_DEVIATION: f64 = 0.8;

/// Target acceptance rate of the proposals (Papaioannou and others 2015, section 3.4).
const ACCEPTED: f64 = 0.44;

/// Lower limit of the steps' standard deviation.
const DEVIATION_MIN: f64 = 0.05;

/// State of a chain.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChainState {
    /// Number of the evaluated point.
    pub number: usize,
    /// Number of its ancestor in the first level: its own number there.
    pub ancestor: usize,
    /// Independent standard normal numbers.
    pub z: Vec<f64>,
    pub score: f64,
}

/// The chains of one level.
#[derive(Debug)]
pub(super) struct Chains {
    /// The states of all chains after each step; the first row holds the seeds, which already belong to the level.
    rows: Vec<Vec<ChainState>>,
    /// Final number of states of a chain.
    length: usize,
    /// Score that all states reach or exceed.
    threshold: f64,
    /// Standard deviation of a step of a standard normal number; 1 makes the step independent of the current state.
    deviation: f64,
    accepted: usize,
    proposed: usize,
}

impl Chains {
    pub(super) fn new(seeds: Vec<ChainState>, length: usize, threshold: f64, deviation: f64) -> Chains {
        Chains {
            rows: vec![seeds],
            length,
            threshold,
            deviation,
            accepted: 0,
            proposed: 0,
        }
    }

    /// The proposals of all chains. The first of these points has the number `first`.
    pub(super) fn propose(&self, coordinates: &[Coordinate], first: usize, level: usize) -> Vec<Candidate> {
        // The correlation for which a step leaves the standard normal distribution invariant.
        let correlation = (1.0 - self.deviation * self.deviation).sqrt();
        let now = self.rows.last().into_iter().flatten();
        let propose = |(at, state): (usize, &ChainState)| {
            let number = first + at;
            let step = |(z, one): (&f64, &Coordinate)| {
                let draw = normal_quantile(one.at(number as u64));
                clamp_open(normal_cumulative(correlation * z + self.deviation * draw))
            };
            Candidate {
                number,
                level,
                parent: Some(state.number),
                u: state.z.iter().zip(coordinates).map(step).collect(),
            }
        };
        now.enumerate().map(propose).collect()
    }

    /// Each chain moves to its candidate if that reaches the threshold, and otherwise repeats its state.
    pub(super) fn step(&mut self, candidates: impl Iterator<Item = ChainState>) {
        let now = self.rows.last().into_iter().flatten();
        let mut row = Vec::new();
        for (state, candidate) in now.zip(candidates) {
            self.proposed += 1;
            // An impossible point has the score NaN, which reaches no threshold.
            let is_accepted = candidate.score >= self.threshold;
            self.accepted += usize::from(is_accepted);
            row.push(match is_accepted {
                true => ChainState {
                    ancestor: state.ancestor,
                    ..candidate
                },
                false => state.clone(),
            });
        }
        self.rows.push(row);
    }

    pub(super) fn is_complete(&self) -> bool {
        self.rows.len() >= self.length
    }

    /// The fraction of accepted proposals.
    pub(super) fn acceptance(&self) -> f64 {
        self.accepted as f64 / self.proposed.max(1) as f64
    }

    /// The standard deviation that brings the next level closer to the target acceptance. It changes only between levels, so that within
    /// one the chains keep its distribution.
    pub(super) fn deviation(&self) -> f64 {
        (self.deviation * (self.acceptance() - ACCEPTED).exp()).clamp(DEVIATION_MIN, 1.0)
    }

    pub(super) fn into_rows(self) -> Vec<Vec<ChainState>> {
        self.rows
    }
}

/// `count` of the states, chosen with equal probability, in their order. `choice` gives each state a random key.
pub(super) fn select_seeds(mut states: Vec<ChainState>, count: usize, choice: &Coordinate) -> Vec<ChainState> {
    if states.len() > count {
        // A state that a chain has repeated occurs more than once.
        let mut keyed: Vec<(f64, usize)> = (0..states.len()).map(|at| (choice.at(at as u64), at)).collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut kept: Vec<usize> = keyed[..count].iter().map(|(_, at)| *at).collect();
        kept.sort_unstable();
        states = kept.into_iter().map(|at| states[at].clone()).collect();
    }
    states
}
