//! Uniform draws without the ends of their interval.

use lockstep::random::Stream;

/// 2^-52: draws are odd multiples of half of it.
const FINEST: f64 = f64::EPSILON;

/// The stream of random numbers of a coordinate.
pub(super) fn stream(seed: u64, name: &str) -> Stream {
    Stream::new(seed, &format!("vary {name}"))
}

/// A uniform draw in (0, 1).
pub(super) fn open(stream: &Stream, index: u64) -> f64 {
    ((stream.bits(index) >> 12) as f64 + 0.5) * FINEST
}

/// What rounding made of a number in (0, 1), with the ends excluded again.
pub(crate) fn inside(u: f64) -> f64 {
    u.clamp(0.5 * FINEST, 1.0 - 0.5 * FINEST)
}
