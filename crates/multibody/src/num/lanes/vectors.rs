//! The types of lanes, each over the operations of a module.

use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};

#[cfg(target_arch = "x86_64")]
use super::eight;
#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
use super::four_avx2 as four;
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
use super::four_portable as four;
use crate::num::number::{Computation, Constant, Lanes, Number};
use crate::num::real::Real;
use crate::num::trig;

/// The type `$lanes` of `$width` doubles with the operations of the module `$imp`; `$compute` runs code compiled for them.
macro_rules! lanes {
    ($(#[$doc:meta])* $lanes:ident, $width:literal, $imp:ident, $compute:path) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $lanes($imp::Repr);

        impl $lanes {
            /// Lanes from an array.
            #[inline(always)]
            pub fn new(x: [f64; $width]) -> Self {
                Self($imp::from_array(x))
            }

            /// The lanes as an array.
            #[inline(always)]
            pub fn to_array(self) -> [f64; $width] {
                $imp::to_array(self.0)
            }

            #[cold]
            #[inline(never)]
            fn sin_cos_one_by_one(self) -> (Self, Self) {
                let each = self.to_array().map(trig::sin_cos);
                (Self::new(each.map(|e| e.0)), Self::new(each.map(|e| e.1)))
            }
        }

        impl Real for $lanes {
            #[inline(always)]
            fn of(x: f64) -> Self {
                Self($imp::splat(x))
            }

            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                Self($imp::mul_add(self.0, a.0, b.0))
            }

            #[inline(always)]
            fn recip(self) -> Self {
                Self($imp::div($imp::splat(1.0), self.0))
            }

            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                if !$imp::none_beyond(self.0, trig::LIMIT) {
                    return self.sin_cos_one_by_one();
                }
                let (s, c, shifted) = trig::reduced(self);
                let (s, c) = $imp::quadrant(shifted.0, s.0, c.0);
                (Self(s), Self(c))
            }
        }

        impl Number for $lanes {
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self($imp::sqrt(self.0))
            }
        }

        impl Lanes for $lanes {
            const WIDTH: usize = $width;

            #[inline(always)]
            fn gather(of: impl FnMut(usize) -> f64) -> Self {
                Self::new(core::array::from_fn(of))
            }

            #[inline(always)]
            fn lane(&self, i: usize) -> f64 {
                const { assert!(size_of::<$lanes>() == size_of::<[f64; $width]>()) };
                // SAFETY: a transparent wrapper of `$width` doubles in order: one of them is read, and the vector is not copied first.
                let all = unsafe { &*(&raw const *self).cast::<[f64; $width]>() };
                all[i]
            }

            #[inline(always)]
            fn compute<C: Computation>(code: C) -> C::Output {
                $compute(code)
            }
        }

        impl Constant<$lanes> for $lanes {
            #[inline(always)]
            fn lift(self) -> $lanes {
                self
            }
        }

        impl PartialEq for $lanes {
            fn eq(&self, o: &Self) -> bool {
                self.to_array() == o.to_array()
            }
        }

        impl Neg for $lanes {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self($imp::neg(self.0))
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

        lanes!(@binary $lanes, $imp, Add, add, AddAssign, add_assign);
        lanes!(@binary $lanes, $imp, Sub, sub, SubAssign, sub_assign);
        lanes!(@binary $lanes, $imp, Mul, mul, MulAssign, mul_assign);
        lanes!(@binary $lanes, $imp, Div, div, DivAssign, div_assign);
    };
    (@binary $lanes:ident, $imp:ident, $op:ident, $f:ident, $assign:ident, $g:ident) => {
        impl $op for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $f(self, o: Self) -> Self {
                Self($imp::$f(self.0, o.0))
            }
        }

        impl $assign for $lanes {
            #[inline(always)]
            fn $g(&mut self, o: Self) {
                self.0 = $imp::$f(self.0, o.0);
            }
        }
    };
}

lanes! {
    /// Four `f64` lanes.
    F64x4, 4, four, run_as_compiled
}

#[cfg(target_arch = "x86_64")]
lanes! {
    /// Eight `f64` lanes.
    ///
    /// Its operations are instructions that a processor may lack. The type is therefore private: only [`with_lanes`](super::with_lanes) names it, once it
    /// found them.
    F64x8, 8, eight, eight::compute
}

/// The instructions of these lanes are compiled in.
#[inline(always)]
fn run_as_compiled<C: Computation>(code: C) -> C::Output {
    code.run()
}
