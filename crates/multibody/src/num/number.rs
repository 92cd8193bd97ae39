//! What a motion is computed with besides the recursions, and doubles side by side as a number.

use core::fmt::Debug;
use core::ops::{AddAssign, Div, DivAssign, MulAssign, SubAssign};

use num_traits::{One, Zero};

use super::Real;

/// A [`Real`] of which nalgebra makes vectors, with a quotient and a root that are rounded once.
pub trait Number:
    Real + Debug + PartialEq + Zero + One + AddAssign + SubAssign + MulAssign + DivAssign + Div<Output = Self>
{
    /// The square root.
    fn sqrt(self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

/// Doubles side by side: every operation acts on each as it would alone, to the last bit.
pub trait Lanes: Number + Constant<Self> {
    /// How many.
    const WIDTH: usize;

    /// Lane i is `of(i)`.
    fn gather(of: impl FnMut(usize) -> f64) -> Self;

    /// Lane `i`.
    ///
    /// # Panics
    /// When there is no such lane.
    fn lane(&self, i: usize) -> f64;
}

/// A constant of a model as a number of a recursion: a double is the same in every lane, lanes are themselves.
pub trait Constant<T>: Copy {
    /// As the number.
    fn lift(self) -> T;
}

impl<T: Real> Constant<T> for f64 {
    #[inline(always)]
    fn lift(self) -> T {
        T::of(self)
    }
}
