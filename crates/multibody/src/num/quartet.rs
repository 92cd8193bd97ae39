//! Four doubles in SIMD lanes as a number.

use core::ops::{AddAssign, DivAssign, MulAssign, SubAssign};

use num_traits::{One, Zero};

use super::number::{Constant, Lanes, Number};
use super::{F64x4, Real};

impl Number for F64x4 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        F64x4::sqrt(self)
    }
}

impl Lanes for F64x4 {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn gather(mut of: impl FnMut(usize) -> f64) -> Self {
        Self::new([of(0), of(1), of(2), of(3)])
    }

    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        self.to_array()[i]
    }
}

impl Constant<F64x4> for F64x4 {
    #[inline(always)]
    fn lift(self) -> F64x4 {
        self
    }
}

impl PartialEq for F64x4 {
    fn eq(&self, o: &Self) -> bool {
        (0..<F64x4 as Lanes>::WIDTH).all(|i| self.lane(i) == o.lane(i))
    }
}

impl Zero for F64x4 {
    #[inline(always)]
    fn zero() -> Self {
        <F64x4 as Real>::of(0.0)
    }

    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl One for F64x4 {
    #[inline(always)]
    fn one() -> Self {
        <F64x4 as Real>::of(1.0)
    }
}

impl AddAssign for F64x4 {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl SubAssign for F64x4 {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl MulAssign for F64x4 {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl DivAssign for F64x4 {
    #[inline(always)]
    fn div_assign(&mut self, o: Self) {
        *self = *self / o;
    }
}
