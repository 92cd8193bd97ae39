//! Latin hypercubes.

use lockstep::random::Stream;

use super::uniform::{clamp_open, stream, uniform_open};

/// Strata of equal width, assigned to the points by a random permutation.
#[derive(Debug, Clone)]
pub(super) struct Strata {
    offsets: Stream,
    /// The stratum of each point.
    stratum_of: Vec<u32>,
}

impl Strata {
    /// Sorting the points by random bits gives the random permutation.
    pub(super) fn new(seed: u64, name: &str, points: u64) -> Strata {
        let keys = Stream::new(seed, &format!("strata {name}"));
        let count = u32::try_from(points.max(1)).unwrap_or(u32::MAX);
        let mut order: Vec<u32> = (0..count).collect();
        order.sort_by_key(|k| (keys.bits(u64::from(*k)), *k));
        let mut stratum_of = vec![0; order.len()];
        for (stratum, k) in (0..count).zip(order) {
            stratum_of[k as usize] = stratum;
        }
        Strata {
            offsets: stream(seed, name),
            stratum_of,
        }
    }

    /// For points beyond the design, the strata repeat from the start.
    pub(super) fn at(&self, k: u64) -> f64 {
        let count = self.stratum_of.len() as u64;
        let stratum = self.stratum_of[(k % count) as usize];
        clamp_open((f64::from(stratum) + uniform_open(&self.offsets, k)) / count as f64)
    }
}
