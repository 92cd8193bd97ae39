//! Operations on four doubles with AVX2 and FMA.

use core::arch::x86_64::*;

/// Four doubles.
pub(super) type Repr = __m256d;

/// Wraps intrinsics that require only a processor feature.
macro_rules! feature_gated {
    ($e:expr) => {
        // SAFETY: this module is compiled only when AVX2 and FMA are enabled for the whole build, and the intrinsics
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
