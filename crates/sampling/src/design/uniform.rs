//! Uniform random numbers in the open interval (0, 1).

use lockstep::random::Stream;

/// 2^-52: the numbers are odd multiples of half of it.
const RESOLUTION: f64 = f64::EPSILON;

/// The stream of random numbers of a coordinate.
pub(super) fn stream(seed: u64, name: &str) -> Stream {
    Stream::new(seed, &format!("vary {name}"))
}

/// A uniform random number in (0, 1).
pub(super) fn uniform_open(stream: &Stream, index: u64) -> f64 {
    ((stream.bits(index) >> 12) as f64 + 0.5) * RESOLUTION
}

/// Clamps a number rounded to an end of (0, 1) back into the open interval.
pub(crate) fn clamp_open(u: f64) -> f64 {
    u.clamp(0.5 * RESOLUTION, 1.0 - 0.5 * RESOLUTION)
}
