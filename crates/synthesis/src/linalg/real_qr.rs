//! Eigenvalues of a real matrix by the QR iteration with implicit double shifts.
//!
//! Sources: Francis 1961; Golub and Van Loan 2013, section 7.5. Only the active block is
//! updated, since no Schur form is wanted. nalgebra's iteration has no exceptional shifts and never ends on loops with samples in
//! transit, whose matrices are close to nilpotent ones.

use nalgebra::{DMatrix, Hessenberg};

use super::deflation::{EXCEPTIONAL_EVERY, ITERATIONS_MAX, active_start, length};
use super::matrix::c64;

/// The eigenvalues of a real square matrix of finite entries; `None` where the iteration does not converge.
pub(super) fn eigenvalues(m: DMatrix<f64>) -> Option<Vec<c64>> {
    let n = m.nrows();
    if n < 2 {
        return Some(m.iter().map(|&x| c64::new(x, 0.0)).collect());
    }
    let mut h = Hessenberg::new(m).unpack_h();
    let mut values = vec![c64::new(0.0, 0.0); n];
    // Rows and columns below `end` are still active.
    let mut end = n;
    let mut iteration = 0;
    while end > 0 {
        let start = active_start(&mut h, end);
        match end - start {
            1 => values[start] = c64::new(h[(start, start)], 0.0),
            2 => {
                let block = [
                    h[(start, start)],
                    h[(start, start + 1)],
                    h[(start + 1, start)],
                    h[(start + 1, start + 1)],
                ];
                [values[start], values[start + 1]] = block_eigenvalues(block);
            }
            _ if iteration == ITERATIONS_MAX => return None,
            _ => {
                iteration += 1;
                let shifts = Shifts::choose(&h, start, end, iteration);
                sweep(&mut h, start, end, shifts);
                continue;
            }
        }
        end = start;
        iteration = 0;
    }
    Some(values)
}

/// The two eigenvalues of `[a b; c d]`.
fn block_eigenvalues([a, b, c, d]: [f64; 4]) -> [c64; 2] {
    let half = 0.5 * (a - d);
    let scale = half.abs().max(b.abs()).max(c.abs());
    if scale == 0.0 {
        return [c64::new(a, 0.0), c64::new(d, 0.0)];
    }
    let discriminant = (half / scale) * (half / scale) + (b / scale) * (c / scale);
    let root = scale * discriminant.abs().sqrt();
    if discriminant < 0.0 {
        let mean = d + half;
        return [c64::new(mean, root), c64::new(mean, -root)];
    }
    // The eigenvalue that is further from d without cancellation, and the other one from the product of both distances.
    let far = half + root.copysign(half);
    let near = if far == 0.0 { 0.0 } else { -(b / far) * c };
    [c64::new(d + far, 0.0), c64::new(d + near, 0.0)]
}

/// Two shifts, both real or conjugate, with these real and imaginary parts.
struct Shifts {
    re: [f64; 2],
    im: f64,
}

impl Shifts {
    /// The eigenvalues of the last two rows, of which a real pair becomes twice the one closer to the last entry; every now and then
    /// exceptional ones, which leave a cycle.
    fn choose(h: &DMatrix<f64>, start: usize, end: usize, iteration: usize) -> Shifts {
        let last = end - 1;
        let exceptional = |at: usize, size: f64| {
            let diagonal = 0.75 * size + h[(at, at)];
            [diagonal, -0.4375 * size, size, diagonal]
        };
        let block = if iteration.is_multiple_of(2 * EXCEPTIONAL_EVERY) {
            exceptional(last, h[(last, last - 1)].abs() + h[(last - 1, last - 2)].abs())
        } else if iteration.is_multiple_of(EXCEPTIONAL_EVERY) {
            exceptional(start, h[(start + 1, start)].abs() + h[(start + 2, start + 1)].abs())
        } else {
            [
                h[(last - 1, last - 1)],
                h[(last - 1, last)],
                h[(last, last - 1)],
                h[(last, last)],
            ]
        };
        let [one, two] = block_eigenvalues(block);
        if one.im != 0.0 {
            return Shifts {
                re: [one.re; 2],
                im: one.im,
            };
        }
        let close = if (one.re - block[3]).abs() <= (two.re - block[3]).abs() {
            one.re
        } else {
            two.re
        };
        Shifts {
            re: [close; 2],
            im: 0.0,
        }
    }

    /// The first three entries of the first column of `(H − s₁)(H − s₂)`, H from row `m` on, but for a factor.
    fn first_column(&self, h: &DMatrix<f64>, m: usize) -> [f64; 3] {
        let [re_1, re_2] = self.re;
        let scale = (h[(m, m)] - re_2).abs() + self.im.abs() + h[(m + 1, m)].abs();
        if scale == 0.0 {
            return [0.0; 3];
        }
        let below = h[(m + 1, m)] / scale;
        let v = [
            below * h[(m, m + 1)] + (h[(m, m)] - re_1) * ((h[(m, m)] - re_2) / scale) + self.im * (self.im / scale),
            below * (h[(m, m)] + h[(m + 1, m + 1)] - re_1 - re_2),
            below * h[(m + 2, m + 1)],
        ];
        let size = v[0].abs() + v[1].abs() + v[2].abs();
        if size == 0.0 { v } else { v.map(|x| x / size) }
    }
}

/// One sweep of the double-shift iteration over the rows `start..end`, at least three.
fn sweep(h: &mut DMatrix<f64>, start: usize, end: usize, shifts: Shifts) {
    // The sweep can begin below two consecutive small subdiagonal entries.
    let mut m = end - 3;
    let mut v = shifts.first_column(h, m);
    while m > start {
        let around = h[(m - 1, m - 1)].abs() + h[(m, m)].abs() + h[(m + 1, m + 1)].abs();
        if h[(m, m - 1)].abs() * (v[1].abs() + v[2].abs()) <= f64::EPSILON * v[0].abs() * around {
            break;
        }
        m -= 1;
        v = shifts.first_column(h, m);
    }
    for k in m..end - 1 {
        let three = k + 2 < end;
        if k > m {
            v = [
                h[(k, k - 1)],
                h[(k + 1, k - 1)],
                if three { h[(k + 2, k - 1)] } else { 0.0 },
            ];
        }
        let (beta, tau, w) = reflector(v);
        if k > m {
            h[(k, k - 1)] = beta;
            h[(k + 1, k - 1)] = 0.0;
            if three {
                h[(k + 2, k - 1)] = 0.0;
            }
        } else if m > start {
            // The other entries of that column are negligible; this one changes its sign or stays.
            h[(k, k - 1)] *= 1.0 - tau;
        }
        if three {
            reflect::<3>(h, k, [1.0, w[0], w[1]], tau, start, end);
        } else {
            reflect::<2>(h, k, [1.0, w[0]], tau, start, end);
        }
    }
}

/// The reflection `I − τ [1 w]ᵀ[1 w]` that takes `v` to `[β 0 0]`: β, τ, w.
fn reflector(v: [f64; 3]) -> (f64, f64, [f64; 2]) {
    let tail = length([v[1], v[2], 0.0]);
    if tail == 0.0 {
        return (v[0], 0.0, [0.0; 2]);
    }
    let beta = -length(v).copysign(v[0]);
    let first = v[0] - beta;
    (beta, (beta - v[0]) / beta, [v[1] / first, v[2] / first])
}

/// Applies a reflection of `ROWS` rows from `k` on from both sides, within the rows and columns `start..end`.
fn reflect<const ROWS: usize>(h: &mut DMatrix<f64>, k: usize, w: [f64; ROWS], tau: f64, start: usize, end: usize) {
    let n = h.nrows();
    let scaled = w.map(|x| tau * x);
    let entries = h.as_mut_slice();
    for column in k..end {
        let rows: &mut [f64] = &mut entries[column * n + k..column * n + k + ROWS];
        let sum: f64 = (0..ROWS).map(|i| w[i] * rows[i]).sum();
        (0..ROWS).for_each(|i| rows[i] -= sum * scaled[i]);
    }
    let last = (k + 4).min(end);
    for row in start..last {
        let at = |i: usize| (k + i) * n + row;
        let sum: f64 = (0..ROWS).map(|i| w[i] * entries[at(i)]).sum();
        (0..ROWS).for_each(|i| entries[at(i)] -= sum * scaled[i]);
    }
}
