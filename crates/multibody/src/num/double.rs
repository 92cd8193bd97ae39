//! A double as a scalar of the kernels. Its sines are computed four at a time, in the lanes.

use super::{F64x4, Real, trig};

impl Real for f64 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        f64::mul_add(self, a, b)
    }

    #[inline(always)]
    fn recip(self) -> Self {
        1.0 / self
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        trig::sin_cos(self)
    }

    #[inline(always)]
    fn sin_cos_each(angles: &[Self], mut put: impl FnMut(Self, Self)) {
        for four in angles.chunks(4) {
            let mut x = [0.0; 4];
            for (x, a) in x.iter_mut().zip(four) {
                *x = *a;
            }
            let (s, c) = F64x4::new(x).sin_cos();
            let (s, c) = (s.to_array(), c.to_array());
            for i in 0..four.len() {
                put(s[i], c[i]);
            }
        }
    }
}
