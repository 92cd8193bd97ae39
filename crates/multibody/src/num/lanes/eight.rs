//! Operations on eight doubles with AVX-512.
//!
//! They are one instruction each inside [`compute`], and slow calls elsewhere. On a processor without AVX-512 they would be undefined
//! behaviour: `F64x8` can only be named after [`is_available`] returned true.

use core::arch::x86_64::*;

use crate::num::number::Computation;

/// Eight doubles.
pub(super) type Repr = __m512d;

/// Whether this processor and the operating system support these operations.
#[inline]
pub(super) fn is_available() -> bool {
    std::is_x86_feature_detected!("avx512f")
        && std::is_x86_feature_detected!("avx512vl")
        && std::is_x86_feature_detected!("avx512dq")
}

/// Runs `code` compiled with the instructions of this module.
#[inline(always)]
pub(super) fn compute<C: Computation>(code: C) -> C::Output {
    #[target_feature(enable = "avx512f,avx512vl,avx512dq")]
    fn compiled_for_avx512<C: Computation>(code: C) -> C::Output {
        code.run()
    }
    // SAFETY: who names `F64x8`, through whose trait this function is reached, has found the processor to support AVX-512.
    unsafe { compiled_for_avx512(code) }
}

/// Wraps intrinsics that require only a processor feature.
macro_rules! feature_gated {
    ($e:expr) => {
        // SAFETY: as in `compute`, the processor supports AVX-512, and the intrinsics used here work on values (or on a local array
        // of the right length), not on foreign memory.
        unsafe { $e }
    };
}

#[inline(always)]
pub(super) fn from_array(x: [f64; 8]) -> Repr {
    feature_gated!(_mm512_loadu_pd(x.as_ptr()))
}
#[inline(always)]
pub(super) fn to_array(x: Repr) -> [f64; 8] {
    let mut out = [0.0; 8];
    feature_gated!(_mm512_storeu_pd(out.as_mut_ptr(), x));
    out
}
#[inline(always)]
pub(super) fn splat(x: f64) -> Repr {
    feature_gated!(_mm512_set1_pd(x))
}
#[inline(always)]
pub(super) fn add(a: Repr, b: Repr) -> Repr {
    feature_gated!(_mm512_add_pd(a, b))
}
#[inline(always)]
pub(super) fn sub(a: Repr, b: Repr) -> Repr {
    feature_gated!(_mm512_sub_pd(a, b))
}
#[inline(always)]
pub(super) fn mul(a: Repr, b: Repr) -> Repr {
    feature_gated!(_mm512_mul_pd(a, b))
}
#[inline(always)]
pub(super) fn div(a: Repr, b: Repr) -> Repr {
    feature_gated!(_mm512_div_pd(a, b))
}
#[inline(always)]
pub(super) fn sqrt(a: Repr) -> Repr {
    feature_gated!(_mm512_sqrt_pd(a))
}
#[inline(always)]
pub(super) fn neg(a: Repr) -> Repr {
    feature_gated!(_mm512_xor_pd(a, _mm512_set1_pd(-0.0)))
}
#[inline(always)]
pub(super) fn mul_add(a: Repr, b: Repr, c: Repr) -> Repr {
    feature_gated!(_mm512_fmadd_pd(a, b, c))
}
#[inline(always)]
pub(super) fn none_beyond(x: Repr, limit: f64) -> bool {
    feature_gated!({
        let magnitude = _mm512_andnot_pd(_mm512_set1_pd(-0.0), x);
        _mm512_cmp_pd_mask::<_CMP_GT_OQ>(magnitude, _mm512_set1_pd(limit)) == 0
    })
}
#[inline(always)]
pub(super) fn quadrant(shifted: Repr, s: Repr, c: Repr) -> (Repr, Repr) {
    feature_gated!({
        let n = _mm512_castpd_si512(shifted);
        let one = _mm512_set1_epi64(1);
        let odd = _mm512_test_epi64_mask(n, one);
        let sin = _mm512_mask_blend_pd(odd, s, c);
        let cos = _mm512_mask_blend_pd(odd, c, s);
        let sign = _mm512_castpd_si512(_mm512_set1_pd(-0.0));
        let sin_sign = _mm512_and_si512(_mm512_slli_epi64::<62>(n), sign);
        let cos_sign = _mm512_and_si512(_mm512_slli_epi64::<62>(_mm512_add_epi64(n, one)), sign);
        (
            _mm512_xor_pd(sin, _mm512_castsi512_pd(sin_sign)),
            _mm512_xor_pd(cos, _mm512_castsi512_pd(cos_sign)),
        )
    })
}
