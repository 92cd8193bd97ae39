//! Dual numbers a + b ε, ε² = 0: run a kernel on them and the ε part is its exact derivative.

use multibody::{Real, sin_cos};
use std::ops::{Add, Mul, Neg, Sub};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Dual {
    pub(crate) v: f64,
    pub(crate) d: f64,
}

impl Add for Dual {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            v: self.v + o.v,
            d: self.d + o.d,
        }
    }
}
impl Sub for Dual {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self {
            v: self.v - o.v,
            d: self.d - o.d,
        }
    }
}
impl Mul for Dual {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self {
            v: self.v * o.v,
            d: self.v * o.d + self.d * o.v,
        }
    }
}
impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { v: -self.v, d: -self.d }
    }
}

impl Real for Dual {
    fn of(x: f64) -> Self {
        Self { v: x, d: 0.0 }
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    fn recip(self) -> Self {
        Self {
            v: 1.0 / self.v,
            d: -self.d / (self.v * self.v),
        }
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = sin_cos(self.v);
        (Self { v: s, d: c * self.d }, Self { v: c, d: -s * self.d })
    }
}
