//! Random numbers that do not depend on order: a draw is a function of (run seed, name, index).
//!
//! The generator is SplitMix64's output function (Steele, Lea, Flood 2014) over a counter, which any language reproduces in ten lines. A
//! process that is started late, restarted or replaced obtains the same draws.

use serde::{Deserialize, Serialize};

use crate::fnv::fnv1a;

/// A stream of random numbers, addressed by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stream {
    key: u64,
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// SplitMix64's finaliser.
const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Stream {
    /// The stream called `name` in a run with seed `seed`. Different names give unrelated streams.
    pub fn new(seed: u64, name: &str) -> Stream {
        // FNV-1a over the name; then two rounds of mixing, so that neighbouring seeds give unrelated streams.
        Stream {
            key: mix(mix(seed.wrapping_add(GOLDEN)) ^ fnv1a(name)),
        }
    }

    /// 64 random bits at `index`.
    pub fn bits(&self, index: u64) -> u64 {
        mix(self.key.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))))
    }

    /// A number in [0, 1), a multiple of 2^-53.
    pub fn uniform(&self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * f64::EPSILON * 0.5
    }

    /// Draw number `index` of a standard normal distribution (Box and Muller), from the uniform draws `2 index` and
    /// `2 index + 1`.
    pub fn normal(&self, index: u64) -> f64 {
        let first = index.wrapping_mul(2);
        // The first uniform number is subtracted from one, so that its logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform(first))).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.uniform(first.wrapping_add(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_draws_are_uniform_and_uncorrelated() {
        let (a, b) = (Stream::new(1, "plant"), Stream::new(2, "plant"));
        let n = 100_000;
        let mean = |s: &Stream| (0..n).map(|i| s.uniform(i)).sum::<f64>() / n as f64;
        assert!((mean(&a) - 0.5).abs() < 0.004 && (mean(&b) - 0.5).abs() < 0.004);
        let covariance = (0..n).map(|i| (a.uniform(i) - 0.5) * (b.uniform(i) - 0.5)).sum::<f64>() / n as f64 * 12.0;
        assert!(covariance.abs() < 0.015, "{covariance}");
        let lagged = (0..n)
            .map(|i| (a.uniform(i) - 0.5) * (a.uniform(i + 1) - 0.5))
            .sum::<f64>()
            / n as f64
            * 12.0;
        assert!(lagged.abs() < 0.015, "{lagged}");
    }

    #[test]
    fn normal_draws_match_moments_of_distribution() {
        let stream = Stream::new(3, "x");
        let n = 200_000;
        let draws: Vec<f64> = (0..n).map(|i| stream.normal(i)).collect();
        let moment = |k: i32| draws.iter().map(|z| z.powi(k)).sum::<f64>() / n as f64;
        assert!(moment(1).abs() < 0.01 && (moment(2) - 1.0).abs() < 0.01);
        assert!(moment(3).abs() < 0.05 && (moment(4) - 3.0).abs() < 0.1);
        assert_eq!(stream.normal(17), draws[17], "the order of calls does not matter");
    }

    /// The numbers other languages must reproduce (docs/protocol.md).
    #[test]
    fn random_stream_matches_documented_values() {
        let stream = Stream::new(42, "link measured");
        assert_eq!(
            [stream.bits(0), stream.bits(1)],
            [2298222421786498984, 18229472497692884557]
        );
    }
}
