//! The scalar trait of the kernels.

use core::ops::{Add, Mul, Neg, Sub};

/// A scalar the kernels can run on: `f64`, four states at once ([`F64x4`](crate::F64x4)), or a user-defined number
/// (the tests differentiate the kernels by running them on dual numbers).
///
/// An implementation must be a field with a fused multiply-add; the kernels call nothing else, and never compare.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + 'static
{
    /// The constant `x` in every lane.
    fn of(x: f64) -> Self;

    /// `self * a + b` with one rounding.
    fn mul_add(self, a: Self, b: Self) -> Self;

    /// `1 / self`.
    fn recip(self) -> Self;

    /// Sine and cosine of `self` (rad).
    fn sin_cos(self) -> (Self, Self);

    /// Sines and cosines of all `angles` (rad), passed to `put` in order.
    ///
    /// Separate from [`sin_cos`](Self::sin_cos) so that one state can evaluate its joints four at a time.
    #[inline(always)]
    fn sin_cos_each(angles: &[Self], mut put: impl FnMut(Self, Self)) {
        for a in angles {
            let (s, c) = a.sin_cos();
            put(s, c);
        }
    }
}
