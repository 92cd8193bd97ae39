//! Operations on four doubles without SIMD instructions.

/// Four doubles.
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
        (out.0[i], out.1[i]) = crate::num::trig::quadrant(shifted[i], s[i], c[i]);
    }
    out
}
