//! Sine and cosine, bit-identical on every machine.
//!
//! Cody and Waite's reduction by multiples of π/2 in two parts with fused multiply-adds, then Taylor polynomials on
//! |r| ≤ π/4. The first omitted terms are r¹⁹/19! < 8.4e-20 for the sine and r¹⁸/18! < 2.1e-18 for the cosine, so
//! truncation is far below rounding, and the result is within one unit in the last place of the `libm` crate's. Angles beyond
//! ±1.6e6 rad, which no joint here reaches, take the slower exact reduction of the `libm` crate.

use super::Real;

/// Largest |x| for which `k·π/2` is subtracted exactly: k stays below 2²⁰.
pub(super) const LIMIT: f64 = 1.6e6;
const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
/// π/2 rounded to double, and the rest of it rounded to double.
const HALF_PI: f64 = core::f64::consts::FRAC_PI_2;
const HALF_PI_REST: f64 = 6.123_233_995_736_766e-17;
/// 1.5·2⁵²: adding it rounds to the nearest integer and leaves that integer in the low bits of the sum.
const SHIFT: f64 = 6_755_399_441_055_744.0;

/// 1/n! for odd n from 17 down to 3 and even n from 16 down to 4, with the signs of the series.
const SIN: [f64; 8] = [
    1.0 / 355_687_428_096_000.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
];
const COS: [f64; 7] = [
    1.0 / 20_922_789_888_000.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 479_001_600.0,
    -1.0 / 3_628_800.0,
    1.0 / 40_320.0,
    -1.0 / 720.0,
    1.0 / 24.0,
];

/// The reduced sine and cosine and the shifted quadrant of |x| ≤ [`LIMIT`].
#[inline(always)]
pub(super) fn reduced<T: Real>(x: T) -> (T, T, T) {
    let shifted = x.mul_add(T::of(TWO_OVER_PI), T::of(SHIFT));
    let minus_k = T::of(SHIFT) - shifted;
    let r1 = minus_k.mul_add(T::of(HALF_PI), x); // exact: both are multiples of 2^-53 and nearly cancel
    let r = minus_k.mul_add(T::of(HALF_PI_REST), r1);
    let rest = minus_k.mul_add(T::of(HALF_PI_REST), r1 - r);

    let z = r * r;
    let z2 = z * z;
    let z4 = z2 * z2;
    // Estrin's scheme: the chain of dependent operations is what costs time
    let pair = |a: f64, b: f64| T::of(a).mul_add(z, T::of(b));
    let high = pair(SIN[0], SIN[1]).mul_add(z2, pair(SIN[2], SIN[3]));
    let low = pair(SIN[4], SIN[5]).mul_add(z2, pair(SIN[6], SIN[7]));
    let poly = high.mul_add(z4, low);
    let sin = r + (r * z).mul_add(poly, rest);

    let high = T::of(COS[0]).mul_add(z2, pair(COS[1], COS[2]));
    let low = pair(COS[3], COS[4]).mul_add(z2, pair(COS[5], COS[6]));
    let poly = high.mul_add(z4, low);
    let half = z * T::of(0.5);
    let one = T::of(1.0);
    let w = one - half;
    let cos = w + ((one - w) - half + z2.mul_add(poly, -(r * rest)));
    (sin, cos, shifted)
}

/// Assigns the reduced values to the quadrant in the low bits of `shifted`.
#[inline(always)]
pub(super) fn quadrant(shifted: f64, s: f64, c: f64) -> (f64, f64) {
    let n = shifted.to_bits();
    let (sin, cos) = if n & 1 == 1 { (c, s) } else { (s, c) };
    let flip = |x: f64, n: u64| f64::from_bits(x.to_bits() ^ ((n & 2) << 62));
    (flip(sin, n), flip(cos, n.wrapping_add(1)))
}

/// Sine and cosine of `x` (rad); NaN for infinities and NaN.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if x.abs() > LIMIT {
        return libm::sincos(x);
    }
    let (s, c, shifted) = reduced(x);
    quadrant(shifted, s, c)
}

#[cfg(test)]
mod tests {
    use super::super::{ForLanes, Lanes, with_lanes};
    use super::*;

    /// Distance in units in the last place of `b`.
    fn ulps(a: f64, b: f64) -> f64 {
        let ulp = f64::from_bits(b.abs().to_bits() + 1) - b.abs();
        (a - b).abs() / ulp
    }

    #[test]
    fn sin_cos_agrees_with_an_independent_implementation() {
        let mut worst = 0.0_f64;
        let mut x = 1.0e-9_f64;
        while x < 1.2e6 {
            for x in [x, -x, x + core::f64::consts::FRAC_PI_2, x + core::f64::consts::PI] {
                let (s, c) = sin_cos(x);
                worst = worst.max(ulps(s, libm::sin(x))).max(ulps(c, libm::cos(x)));
            }
            x *= 1.000_13;
        }
        // both claim less than one ulp from the truth, so they may differ by one last bit
        assert!(worst <= 1.0, "worst difference {worst} ulp");
    }

    #[test]
    fn lanes_have_the_bits_of_the_scalar() {
        let xs = [
            0.0,
            -0.0,
            1.0e-300,
            0.7,
            -0.8,
            2.4,
            3.2,
            -5.5,
            1.0e5,
            -1.0e5,
            1.0e9,
            -3.0e12,
            f64::INFINITY,
            f64::NAN,
        ];
        struct Check<'a>(&'a [f64]);

        impl ForLanes for Check<'_> {
            type Output = ();

            fn run<T: Lanes>(self) {
                let pairs = self.0.iter().flat_map(|a| self.0.iter().map(move |b| (*a, *b)));
                for (a, b) in pairs {
                    let each = |lane: usize| [a, b, 0.3][lane % 3];
                    let (s, c) = T::gather(each).sin_cos();
                    for lane in 0..T::WIDTH {
                        let (x, s, c) = (each(lane), s.lane(lane), c.lane(lane));
                        let (s1, c1) = sin_cos(x);
                        assert!(s.to_bits() == s1.to_bits() || s.is_nan() && s1.is_nan(), "sin {x}");
                        assert!(c.to_bits() == c1.to_bits() || c.is_nan() && c1.is_nan(), "cos {x}");
                    }
                }
            }
        }

        for lanes in [4, 8] {
            with_lanes(lanes, Check(&xs));
        }
    }

    #[test]
    fn nan_input_gives_nan_output() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (s, c) = sin_cos(x);
            assert!(s.is_nan() && c.is_nan());
        }
    }
}
