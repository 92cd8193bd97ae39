//! Designs of experiments: point sets of a campaign in the unit cube, one coordinate at a time.

mod joe_kuo;
mod latin;
mod sobol;
mod uniform;

use lockstep::random::Stream;

pub use joe_kuo::DIMENSIONS;
use latin::Strata;
use sobol::Scrambled;
pub(crate) use uniform::clamp_open;
use uniform::{stream, uniform_open};

/// One axis of the unit cube.
#[derive(Debug, Clone)]
pub struct Coordinate(Method);

#[derive(Debug, Clone)]
enum Method {
    Random(Stream),
    Latin(Strata),
    Sobol(Box<Scrambled>),
}

impl Coordinate {
    /// Independent random numbers of the stream `vary NAME`.
    pub fn random(seed: u64, name: &str) -> Coordinate {
        Coordinate(Method::Random(stream(seed, name)))
    }

    /// A Latin hypercube of `points` points: each of `points` equal strata contains one. Every value depends on the number of points.
    pub fn latin_hypercube(seed: u64, name: &str, points: u64) -> Coordinate {
        Coordinate(Method::Latin(Strata::new(seed, name, points)))
    }

    /// Dimension `dimension`, from 0, of a Sobol' sequence with Owen's nested uniform scrambling. `None` from [`DIMENSIONS`] on.
    pub fn sobol(seed: u64, name: &str, dimension: usize) -> Option<Coordinate> {
        Some(Coordinate(Method::Sobol(Box::new(Scrambled::new(
            seed, name, dimension,
        )?))))
    }

    /// The coordinate of point `k`, from 0: in the open interval (0, 1).
    pub fn at(&self, k: u64) -> f64 {
        match &self.0 {
            Method::Random(stream) => uniform_open(stream, k),
            Method::Latin(strata) => strata.at(k),
            Method::Sobol(sequence) => sequence.at(k),
        }
    }
}

/// Point `k` of dimension `dimension` without scrambling, as a multiple of 2^-32. `None` from [`DIMENSIONS`] on.
pub fn unscrambled_sobol(dimension: usize, k: u64) -> Option<u32> {
    Some(sobol::Sequence::new(dimension)?.at(k))
}
