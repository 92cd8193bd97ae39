//! What both QR iterations share: when an eigenvalue has been found, and their limits.
//!
//! Source of the criterion: Ahues and Tisseur 1997. The size of a complex entry is |re| + |im|, which is as good as its modulus.

use nalgebra::DMatrix;

use super::matrix::Scalar;

/// Most iterations for one eigenvalue; two or three are usual.
pub(super) const ITERATIONS_MAX: usize = 300;
/// After so many iterations without a deflation the shift is an exceptional one.
pub(super) const EXCEPTIONAL_EVERY: usize = 10;

/// The first row of the active block that ends before `end`: the subdiagonal entry before it is negligible, and set to zero.
pub(super) fn active_start<T: Scalar>(h: &mut DMatrix<T>, end: usize) -> usize {
    let n = h.nrows();
    for k in (1..end).rev() {
        let mut neighbours = h[(k - 1, k - 1)].norm1() + h[(k, k)].norm1();
        if neighbours == 0.0 {
            neighbours += if k >= 2 { h[(k - 1, k - 2)].norm1() } else { 0.0 };
            neighbours += if k + 1 < n { h[(k + 1, k)].norm1() } else { 0.0 };
        }
        let (below, above) = (h[(k, k - 1)].norm1(), h[(k - 1, k)].norm1());
        let gap = (h[(k - 1, k - 1)] - h[(k, k)]).norm1();
        if is_negligible(below, above, h[(k, k)].norm1(), gap, neighbours) {
            h[(k, k - 1)] = T::zero();
            return k;
        }
    }
    0
}

/// Whether a subdiagonal entry can be taken for zero without changing the eigenvalues by more than rounding error: relative to the
/// diagonal entries beside it (`neighbours`), and in the product with the entry `above` the diagonal (Ahues and Tisseur).
fn is_negligible(below: f64, above: f64, diagonal: f64, gap: f64, neighbours: f64) -> bool {
    if below <= f64::MIN_POSITIVE / f64::EPSILON {
        return true;
    }
    if below > f64::EPSILON * neighbours {
        return false;
    }
    let (larger, smaller) = (below.max(above), below.min(above));
    let (wide, narrow) = (diagonal.max(gap), diagonal.min(gap));
    let sum = wide + larger;
    smaller * (larger / sum) <= (f64::EPSILON * (narrow * (wide / sum))).max(f64::MIN_POSITIVE)
}

/// The Euclidean length, also where squares overflow or vanish.
pub(super) fn length(v: [f64; 3]) -> f64 {
    let largest = v[0].abs().max(v[1].abs()).max(v[2].abs());
    let of = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    match largest {
        0.0 => 0.0,
        1e-140..1e140 => of(v),
        _ => largest * of(v.map(|x| x / largest)),
    }
}
