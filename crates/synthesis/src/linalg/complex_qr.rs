//! The Schur form of a complex matrix by the QR iteration with single shifts.
//!
//! Sources: Golub and Van Loan 2013, sections 7.4 and 7.5; with Wilkinson's shift and exceptional ones.

use nalgebra::{ComplexField, DMatrix, Hessenberg};

use super::deflation::{EXCEPTIONAL_EVERY, ITERATIONS_MAX, active_start, length};
use super::matrix::c64;

/// A matrix as `Q T Qᴴ`.
pub(super) struct Schur {
    /// Upper triangular, or nothing but its diagonal where only eigenvalues were asked for.
    pub(super) t: DMatrix<c64>,
    /// Unitary; empty where only eigenvalues were asked for.
    pub(super) q: DMatrix<c64>,
}

/// The Schur form of a square matrix of finite entries; `None` where the iteration does not converge.
pub(super) fn schur(m: DMatrix<c64>, vectors: bool) -> Option<Schur> {
    let n = m.nrows();
    if n < 2 {
        return Some(Schur {
            t: m,
            q: DMatrix::identity(n, n),
        });
    }
    let hessenberg = Hessenberg::new(m);
    let (q, h) = if vectors {
        hessenberg.unpack()
    } else {
        (DMatrix::zeros(0, 0), hessenberg.unpack_h())
    };
    let mut form = Schur { t: h, q };
    // Rows and columns below `end` are still active.
    let mut end = n;
    let mut iteration = 0;
    while end > 0 {
        let start = active_start(&mut form.t, end);
        if start + 1 == end {
            end -= 1;
            iteration = 0;
            continue;
        }
        if iteration == ITERATIONS_MAX {
            return None;
        }
        iteration += 1;
        let shift = shift(&form.t, start, end, iteration);
        form.sweep(start, end, shift, vectors);
    }
    Some(form)
}

/// The eigenvalue of the last two rows that is closer to the last entry; every now and then another shift, which leaves a cycle.
fn shift(h: &DMatrix<c64>, start: usize, end: usize, iteration: usize) -> c64 {
    let last = end - 1;
    if iteration.is_multiple_of(2 * EXCEPTIONAL_EVERY) {
        return h[(last, last)] + 0.75 * h[(last, last - 1)].norm1();
    }
    if iteration.is_multiple_of(EXCEPTIONAL_EVERY) {
        return h[(start, start)] + 0.75 * h[(start + 1, start)].norm1();
    }
    let corner = h[(last, last)];
    let geometric = h[(last - 1, last)].sqrt() * h[(last, last - 1)].sqrt();
    let half = (h[(last - 1, last - 1)] - corner) * 0.5;
    let scale = geometric.norm1().max(half.norm1());
    if geometric.norm1() == 0.0 {
        return corner;
    }
    let (x, u) = (half / scale, geometric / scale);
    let root = (x * x + u * u).sqrt() * scale;
    // The sum that does not cancel gives the eigenvalue that is closer.
    let root = if half.re * root.re + half.im * root.im < 0.0 {
        -root
    } else {
        root
    };
    corner - geometric * (geometric / (half + root))
}

impl Schur {
    /// One sweep over the rows `start..end`, at least two; with `whole`, the triangle outside them and Q are kept up to date.
    fn sweep(&mut self, start: usize, end: usize, shift: c64, whole: bool) {
        let n = self.t.nrows();
        let h = &mut self.t;
        // The sweep can begin below two consecutive small subdiagonal entries.
        let mut m = end - 2;
        while m > start {
            let (first, below) = ((h[(m, m)] - shift).norm1(), h[(m + 1, m)].norm1());
            let sum = first + below;
            let around = h[(m, m)].norm1() + h[(m + 1, m + 1)].norm1();
            if sum > 0.0 && h[(m, m - 1)].norm1() * (below / sum) <= f64::EPSILON * (first / sum) * around {
                break;
            }
            m -= 1;
        }
        let (rows_from, columns_to) = if whole { (0, n) } else { (start, end) };
        let mut v = (h[(m, m)] - shift, h[(m + 1, m)]);
        for k in m..end - 1 {
            if k > m {
                v = (h[(k, k - 1)], h[(k + 1, k - 1)]);
            }
            let (c, s, r) = rotation(v.0, v.1);
            if k > m {
                h[(k, k - 1)] = r;
                h[(k + 1, k - 1)] = c64::new(0.0, 0.0);
            } else if m > start {
                h[(k, k - 1)] *= c;
            }
            for column in k..columns_to {
                let (upper, lower) = (h[(k, column)], h[(k + 1, column)]);
                h[(k, column)] = upper * c + s * lower;
                h[(k + 1, column)] = lower * c - s.conj() * upper;
            }
            rotate_columns(h, k, rows_from..(k + 3).min(end), c, s);
            if whole {
                rotate_columns(&mut self.q, k, 0..n, c, s);
            }
        }
    }
}

/// Columns k and k + 1 times the adjoint of `[c s; −s̄ c]`.
fn rotate_columns(m: &mut DMatrix<c64>, k: usize, rows: std::ops::Range<usize>, c: f64, s: c64) {
    let (mut left, mut right) = m.columns_range_pair_mut(k, k + 1);
    for row in rows {
        let (a, b) = (left[row], right[row]);
        left[row] = a * c + s.conj() * b;
        right[row] = b * c - s * a;
    }
}

/// c real and s with `[c s; −s̄ c] [x y]ᵀ = [r 0]ᵀ`, and r.
fn rotation(x: c64, y: c64) -> (f64, c64, c64) {
    let zero = c64::new(0.0, 0.0);
    if y == zero {
        return (1.0, zero, x);
    }
    if x == zero {
        let all = length([y.re, y.im, 0.0]);
        return (0.0, y.conj() / all, c64::new(all, 0.0));
    }
    let own = length([x.re, x.im, 0.0]);
    let all = length([own, y.re, y.im]);
    let phase = x / own;
    (own / all, phase * (y.conj() / all), phase * all)
}
