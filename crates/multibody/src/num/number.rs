//! Scalar traits for the integration of a motion, and SIMD lanes as a number.

use core::fmt::Debug;
use core::ops::{AddAssign, Div, DivAssign, MulAssign, SubAssign};

use num_traits::{One, Zero};

use super::Real;

/// A [`Real`] that nalgebra vectors can hold, with correctly rounded division and square root.
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

/// SIMD lanes of doubles: every operation acts on each lane bit for bit as on a single double.
pub trait Lanes: Number + Constant<Self> {
    /// Number of lanes.
    const WIDTH: usize;

    /// Lane i is `of(i)`.
    fn gather(of: impl FnMut(usize) -> f64) -> Self;

    /// Lane `i`.
    ///
    /// # Panics
    /// When there is no such lane.
    fn lane(&self, i: usize) -> f64;

    /// Runs `code` compiled for the instructions of these lanes, which may be more than the program is compiled for: inside an operation is
    /// one instruction, elsewhere it is a call.
    fn compute<C: Computation>(code: C) -> C::Output;
}

/// A computation in lanes of a known type, for [`Lanes::compute`].
pub trait Computation {
    /// What it computes.
    type Output;

    /// The computation. It and the functions that it calls must be `#[inline(always)]`: only what is inlined is compiled for the
    /// instructions of the lanes.
    fn run(self) -> Self::Output;
}

/// A constant of a model as a number of a recursion: a double is broadcast to every lane, lanes are used as they are.
pub trait Constant<T>: Copy {
    /// Conversion to the number.
    fn lift(self) -> T;
}

impl<T: Real> Constant<T> for f64 {
    #[inline(always)]
    fn lift(self) -> T {
        T::of(self)
    }
}
