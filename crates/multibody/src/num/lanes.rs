//! Four doubles in SIMD lanes.
//!
//! Each operation acts on the lanes separately and rounds each as the scalar operation does, so a kernel run on
//! [`F64x4`] is bit-identical in every lane to a run on that state alone. With AVX and FMA compiled in (the
//! workspace's `x86-64-v3` baseline) an operation is one instruction; elsewhere it is a loop over four with the same
//! bits, only slower.

use super::{Real, trig};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Four `f64` lanes.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F64x4(imp::Repr);

impl F64x4 {
    /// Lanes from an array.
    #[inline(always)]
    pub fn new(x: [f64; 4]) -> Self {
        Self(imp::from_array(x))
    }

    /// The lanes as an array.
    #[inline(always)]
    pub fn to_array(self) -> [f64; 4] {
        imp::to_array(self.0)
    }

    /// The lanes the quadrant `n` (in the low bits of `shifted`, see `trig`) assigns to sine and cosine.
    #[inline(always)]
    fn quadrant(shifted: Self, s: Self, c: Self) -> (Self, Self) {
        let (s, c) = imp::quadrant(shifted.0, s.0, c.0);
        (Self(s), Self(c))
    }

    /// The square roots.
    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(imp::sqrt(self.0))
    }

    /// Whether every lane is at most `limit` in magnitude or not a number.
    #[inline(always)]
    fn none_beyond(self, limit: f64) -> bool {
        imp::none_beyond(self.0, limit)
    }
}

impl Add for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self(imp::add(self.0, o.0))
    }
}

impl Sub for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self(imp::sub(self.0, o.0))
    }
}

impl Mul for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self(imp::mul(self.0, o.0))
    }
}

impl Div for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        Self(imp::div(self.0, o.0))
    }
}

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(imp::neg(self.0))
    }
}

impl Real for F64x4 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        Self(imp::splat(x))
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(imp::mul_add(self.0, a.0, b.0))
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self(imp::div(imp::splat(1.0), self.0))
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        if !self.none_beyond(trig::LIMIT) {
            return one_by_one(self);
        }
        let (s, c, shifted) = trig::reduced(self);
        F64x4::quadrant(shifted, s, c)
    }
}

#[cold]
#[inline(never)]
fn one_by_one(x: F64x4) -> (F64x4, F64x4) {
    let each = x.to_array().map(trig::sin_cos);
    (F64x4::new(each.map(|e| e.0)), F64x4::new(each.map(|e| e.1)))
}

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
mod imp {
    use core::arch::x86_64::*;

    pub(super) type Repr = __m256d;

    /// Wraps intrinsics that require only a processor feature.
    macro_rules! feature_gated {
        ($e:expr) => {
            // SAFETY: this module exists only when AVX2 and FMA are enabled for the whole build, and the intrinsics
            // used here work on values (or on a local array of the right length), not on foreign memory.
            unsafe { $e }
        };
    }

    #[inline(always)]
    pub(super) fn from_array(x: [f64; 4]) -> Repr {
        feature_gated!(_mm256_loadu_pd(x.as_ptr()))
    }
    #[inline(always)]
    pub(super) fn to_array(x: Repr) -> [f64; 4] {
        let mut out = [0.0; 4];
        feature_gated!(_mm256_storeu_pd(out.as_mut_ptr(), x));
        out
    }
    #[inline(always)]
    pub(super) fn splat(x: f64) -> Repr {
        feature_gated!(_mm256_set1_pd(x))
    }
    #[inline(always)]
    pub(super) fn add(a: Repr, b: Repr) -> Repr {
        feature_gated!(_mm256_add_pd(a, b))
    }
    #[inline(always)]
    pub(super) fn sub(a: Repr, b: Repr) -> Repr {
        feature_gated!(_mm256_sub_pd(a, b))
    }
    #[inline(always)]
    pub(super) fn mul(a: Repr, b: Repr) -> Repr {
        feature_gated!(_mm256_mul_pd(a, b))
    }
    #[inline(always)]
    pub(super) fn div(a: Repr, b: Repr) -> Repr {
        feature_gated!(_mm256_div_pd(a, b))
    }
    #[inline(always)]
    pub(super) fn sqrt(a: Repr) -> Repr {
        feature_gated!(_mm256_sqrt_pd(a))
    }
    #[inline(always)]
    pub(super) fn neg(a: Repr) -> Repr {
        feature_gated!(_mm256_xor_pd(a, _mm256_set1_pd(-0.0)))
    }
    #[inline(always)]
    pub(super) fn mul_add(a: Repr, b: Repr, c: Repr) -> Repr {
        feature_gated!(_mm256_fmadd_pd(a, b, c))
    }
    #[inline(always)]
    pub(super) fn none_beyond(x: Repr, limit: f64) -> bool {
        feature_gated!({
            let magnitude = _mm256_andnot_pd(_mm256_set1_pd(-0.0), x);
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(magnitude, _mm256_set1_pd(limit))) == 0
        })
    }
    #[inline(always)]
    pub(super) fn quadrant(shifted: Repr, s: Repr, c: Repr) -> (Repr, Repr) {
        feature_gated!({
            let n = _mm256_castpd_si256(shifted);
            // blendv selects by the sign bit of each lane: move bit 0 of the quadrant there
            let odd = _mm256_castsi256_pd(_mm256_slli_epi64::<63>(n));
            let sin = _mm256_blendv_pd(s, c, odd);
            let cos = _mm256_blendv_pd(c, s, odd);
            let sign = _mm256_castpd_si256(_mm256_set1_pd(-0.0));
            let sin_sign = _mm256_and_si256(_mm256_slli_epi64::<62>(n), sign);
            let next = _mm256_add_epi64(n, _mm256_set1_epi64x(1));
            let cos_sign = _mm256_and_si256(_mm256_slli_epi64::<62>(next), sign);
            (
                _mm256_xor_pd(sin, _mm256_castsi256_pd(sin_sign)),
                _mm256_xor_pd(cos, _mm256_castsi256_pd(cos_sign)),
            )
        })
    }
}

#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
mod imp {
    pub(super) type Repr = [f64; 4];

    #[inline(always)]
    fn map(a: Repr, b: Repr, f: impl Fn(f64, f64) -> f64) -> Repr {
        core::array::from_fn(|i| f(a[i], b[i]))
    }
    #[inline(always)]
    pub(super) fn from_array(x: [f64; 4]) -> Repr {
        x
    }
    #[inline(always)]
    pub(super) fn to_array(x: Repr) -> [f64; 4] {
        x
    }
    #[inline(always)]
    pub(super) fn splat(x: f64) -> Repr {
        [x; 4]
    }
    #[inline(always)]
    pub(super) fn add(a: Repr, b: Repr) -> Repr {
        map(a, b, |a, b| a + b)
    }
    #[inline(always)]
    pub(super) fn sub(a: Repr, b: Repr) -> Repr {
        map(a, b, |a, b| a - b)
    }
    #[inline(always)]
    pub(super) fn mul(a: Repr, b: Repr) -> Repr {
        map(a, b, |a, b| a * b)
    }
    #[inline(always)]
    pub(super) fn div(a: Repr, b: Repr) -> Repr {
        map(a, b, |a, b| a / b)
    }
    #[inline(always)]
    pub(super) fn sqrt(a: Repr) -> Repr {
        a.map(f64::sqrt)
    }
    #[inline(always)]
    pub(super) fn neg(a: Repr) -> Repr {
        a.map(|a| -a)
    }
    #[inline(always)]
    pub(super) fn mul_add(a: Repr, b: Repr, c: Repr) -> Repr {
        core::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
    }
    #[inline(always)]
    pub(super) fn none_beyond(x: Repr, limit: f64) -> bool {
        !x.iter().any(|x| x.abs() > limit)
    }
    #[inline(always)]
    pub(super) fn quadrant(shifted: Repr, s: Repr, c: Repr) -> (Repr, Repr) {
        let mut out = (s, c);
        for i in 0..4 {
            (out.0[i], out.1[i]) = super::super::trig::quadrant(shifted[i], s[i], c[i]);
        }
        out
    }
}
