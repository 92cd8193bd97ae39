//! The standard normal distribution.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// The probability of a value below `x`.
pub fn cumulative(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

/// The quantile, exceeded with probability 1 - `u`: the inverse of [`cumulative`], for `u` in (0, 1).
pub fn quantile(u: f64) -> f64 {
    if u < 0.5 {
        lower_quantile(u)
    } else {
        -lower_quantile(1.0 - u)
    }
}

/// Newton's method on the logarithm of the distribution function, which is concave: the iterates stay left of the root, and
/// convergence is quadratic at the end.
fn lower_quantile(u: f64) -> f64 {
    // The probability below -t is at most exp(-t²/2)/2, so this lies to the left.
    let mut x = -libm::sqrt(-2.0 * libm::log(2.0 * u.min(0.5)));
    for _ in 0..100 {
        let below = cumulative(x);
        let density = libm::exp(-0.5 * x * x) / libm::sqrt(TAU);
        let step = libm::log(below / u) * below / density;
        x -= step;
        if step.abs() < 1e-9 {
            break;
        }
    }
    x
}
