//! Peaks of samples. NaN counts as larger and smaller than every number and is kept: a sample that is not a number must not
//! vanish from the figure on which a criterion is decided.

/// The larger of two numbers, NaN if either is NaN. In a build optimised for size, `f64::max` is a call of the C library,
/// dozens at every step of the plant; and it ignores NaN.
#[inline(always)]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// The smaller of two numbers, as [`larger`].
#[inline(always)]
pub(super) fn smaller(a: f64, b: f64) -> f64 {
    if b < a || b.is_nan() { b } else { a }
}

/// The largest size of `values`.
pub(super) fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |largest_so_far, value| larger(largest_so_far, value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_is_kept_wherever_it_stands() {
        for values in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(largest(&values).is_nan());
            assert!(values.into_iter().fold(0.0, smaller).is_nan());
        }
        assert_eq!(largest(&[1.0, -3.0, 2.0]), 3.0);
        assert_eq!([1.0, -3.0, 2.0].into_iter().fold(0.0, smaller), -3.0);
    }
}
