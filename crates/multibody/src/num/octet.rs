//! Eight doubles side by side, and what both widths need to be numbers.

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};

use super::number::{Constant, Lanes, Number};
use super::{F64x4, Real};

/// Eight `f64` lanes: two [`F64x4`], whose operations do not wait for each other.
#[derive(Clone, Copy, Debug)]
pub struct F64x8([F64x4; 2]);

impl F64x8 {
    #[inline(always)]
    fn map(self, f: impl Fn(F64x4) -> F64x4) -> Self {
        Self([f(self.0[0]), f(self.0[1])])
    }

    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(F64x4, F64x4) -> F64x4) -> Self {
        Self([f(self.0[0], o.0[0]), f(self.0[1], o.0[1])])
    }
}

impl Add for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.zip(o, |a, b| a + b)
    }
}

impl Sub for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.zip(o, |a, b| a - b)
    }
}

impl Mul for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.zip(o, |a, b| a * b)
    }
}

impl Div for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        self.zip(o, |a, b| a / b)
    }
}

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl Real for F64x8 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        Self([F64x4::of(x); 2])
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self([
            self.0[0].mul_add(a.0[0], b.0[0]),
            self.0[1].mul_add(a.0[1], b.0[1]),
        ])
    }

    #[inline(always)]
    fn recip(self) -> Self {
        self.map(F64x4::recip)
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (a, b) = (self.0[0].sin_cos(), self.0[1].sin_cos());
        (Self([a.0, b.0]), Self([a.1, b.1]))
    }
}

impl Number for F64x4 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        F64x4::sqrt(self)
    }
}

impl Number for F64x8 {
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(F64x4::sqrt)
    }
}

impl Lanes for F64x4 {
    const WIDTH: usize = 4;

    #[inline(always)]
    fn gather(of: impl FnMut(usize) -> f64) -> Self {
        Self::new(core::array::from_fn(of))
    }

    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        self.to_array()[i]
    }
}

impl Lanes for F64x8 {
    const WIDTH: usize = 8;

    #[inline(always)]
    fn gather(mut of: impl FnMut(usize) -> f64) -> Self {
        Self([F64x4::gather(&mut of), F64x4::gather(|i| of(4 + i))])
    }

    #[inline(always)]
    fn lane(&self, i: usize) -> f64 {
        self.0[i / 4].lane(i % 4)
    }
}

/// What follows from the operations.
macro_rules! a_number {
    ($lanes:ty) => {
        impl Constant<$lanes> for $lanes {
            #[inline(always)]
            fn lift(self) -> $lanes {
                self
            }
        }

        impl PartialEq for $lanes {
            fn eq(&self, o: &Self) -> bool {
                (0..<$lanes as Lanes>::WIDTH).all(|i| self.lane(i) == o.lane(i))
            }
        }

        impl Zero for $lanes {
            #[inline(always)]
            fn zero() -> Self {
                <$lanes as Real>::of(0.0)
            }

            fn is_zero(&self) -> bool {
                *self == Self::zero()
            }
        }

        impl One for $lanes {
            #[inline(always)]
            fn one() -> Self {
                <$lanes as Real>::of(1.0)
            }
        }

        impl AddAssign for $lanes {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }

        impl SubAssign for $lanes {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                *self = *self - o;
            }
        }

        impl MulAssign for $lanes {
            #[inline(always)]
            fn mul_assign(&mut self, o: Self) {
                *self = *self * o;
            }
        }

        impl DivAssign for $lanes {
            #[inline(always)]
            fn div_assign(&mut self, o: Self) {
                *self = *self / o;
            }
        }
    };
}

a_number!(F64x4);
a_number!(F64x8);
