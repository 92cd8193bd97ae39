//! Balancing: diagonal similarity scalings by powers of two, which leave every mantissa unchanged.

use crate::linalg::{CMatrix, Matrix};

/// Scale factors `t` (powers of two) such that `diag(t)⁻¹ M diag(t)` has rows and columns of comparable 1-norm.
/// `off(i, j)` is |M(i, j)|, `row(i)` and `column(i)` are the norms attached to state i outside M.
///
/// Source: Parlett and Reinsch 1969; the variant with input and output matrices is Varga's (SLICOT TB01ID describes it).
pub(crate) fn scalings(
    n: usize,
    off: impl Fn(usize, usize) -> f64,
    row: impl Fn(usize) -> f64,
    column: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let mut t = vec![1.0f64; n];
    // Each pass lowers the norm by at least 5 % somewhere, so the loop terminates; the bound guards against degenerate input.
    for _ in 0..100 {
        let mut changed = false;
        for i in 0..n {
            let mut c = column(i) * t[i];
            let mut r = row(i) / t[i];
            for j in (0..n).filter(|&j| j != i) {
                c += off(j, i) * t[i] / t[j];
                r += off(i, j) * t[j] / t[i];
            }
            if c == 0.0 || r == 0.0 || !c.is_finite() || !r.is_finite() {
                continue;
            }
            let before = c + r;
            let mut factor = 1.0;
            while c * factor * 2.0 <= r / factor {
                factor *= 2.0;
            }
            while c * factor >= 2.0 * r / factor {
                factor /= 2.0;
            }
            if factor != 1.0 && c * factor + r / factor < 0.95 * before {
                t[i] *= factor;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    t
}

/// A matrix similar to `m`, balanced.
pub fn balanced(m: &Matrix) -> Matrix {
    let n = m.nrows();
    let t = scalings(n, |i, j| m[(i, j)].abs(), |_| 0.0, |_| 0.0);
    Matrix::from_fn(n, n, |i, j| m[(i, j)] * t[j] / t[i])
}

/// A complex matrix similar to `m`, balanced.
pub fn balanced_complex(m: &CMatrix) -> CMatrix {
    let n = m.nrows();
    let t = scalings(n, |i, j| m[(i, j)].norm(), |_| 0.0, |_| 0.0);
    CMatrix::from_fn(n, n, |i, j| m[(i, j)] * (t[j] / t[i]))
}
