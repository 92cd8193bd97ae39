//! The gain of a closed loop at one frequency, in double-double arithmetic (31 digits).
//!
//! With large gains slow modes are small differences of large numbers: `A + B K C` rounded to doubles is then a different loop
//! from the exact one. Here the product is never formed. Plant and gain enter unchanged, as one linear system in states,
//! controls and measurements, and only the transfer matrix is rounded.

use std::ops::Range;

use twofloat::TwoFloat;

use crate::linalg::{self, CMatrix, LinalgError, Matrix, c64};
use crate::state_space::StateSpace;

/// A plant with inputs [w; u] and outputs [z; y], closed by `u = K y`.
pub(crate) struct Loop<'a> {
    pub(crate) plant: &'a StateSpace,
    pub(crate) k: &'a Matrix,
}

impl Loop<'_> {
    /// Largest singular value at ω of the rows `outputs` of z against the columns `inputs` of w.
    pub(crate) fn gain(&self, outputs: &Range<usize>, inputs: &Range<usize>, omega: f64) -> Result<f64, LinalgError> {
        let p = self.plant;
        let (nu, ny) = (self.k.nrows(), self.k.ncols());
        let (nw, nz) = (p.inputs() - nu, p.outputs() - ny);
        // At infinite frequency the states do not respond.
        let n = if omega.is_infinite() { 0 } else { p.states() };
        let m = n + nu + ny;
        let width = inputs.len();
        // [jω − A, −B₂, 0; 0, I, −K; −C₂, −D₂₂, I] [x; u; y] = [B₁; 0; D₂₁] w
        let entry = |i: usize, j: usize| -> f64 {
            let unit = f64::from(u8::from(i == j));
            match (i < n, i < n + nu, j < n, j < n + nu) {
                (true, _, true, _) => -p.a[(i, j)],
                (true, _, _, true) => -p.b[(i, nw + j - n)],
                (true, ..) | (_, true, true, _) => 0.0,
                (_, true, _, true) => unit,
                (_, true, ..) => -self.k[(i - n, j - n - nu)],
                (_, _, true, _) => -p.c[(nz + i - n - nu, j)],
                (_, _, _, true) => -p.d[(nz + i - n - nu, nw + j - n)],
                _ => unit,
            }
        };
        let drive = |i: usize, w: usize| match (i < n, i < n + nu) {
            (true, _) => p.b[(i, w)],
            (_, true) => 0.0,
            _ => p.d[(nz + i - n - nu, w)],
        };
        let number = TwoFloat::from;
        // Real and imaginary parts as one real system of twice the size.
        let mut rows: Vec<Vec<TwoFloat>> = (0..2 * m)
            .map(|row| {
                let (i, lower) = (row % m, row >= m);
                let mut line = vec![number(0.0); 2 * m + width];
                for j in 0..m {
                    line[if lower { m + j } else { j }] = number(entry(i, j));
                }
                if i < n {
                    line[if lower { i } else { m + i }] = number(if lower { omega } else { -omega });
                }
                if !lower {
                    for (c, w) in inputs.clone().enumerate() {
                        line[2 * m + c] = number(drive(i, w));
                    }
                }
                line
            })
            .collect();
        if !eliminate(&mut rows) {
            return Ok(f64::INFINITY);
        }
        let part = |i: usize, w: usize, imaginary: bool| {
            let mut sum = number(if imaginary { 0.0 } else { p.d[(i, inputs.start + w)] });
            let first = if imaginary { m } else { 0 };
            for j in 0..n {
                sum += number(p.c[(i, j)]) * rows[first + j][2 * m + w];
            }
            for j in 0..nu {
                sum += number(p.d[(i, nw + j)]) * rows[first + n + j][2 * m + w];
            }
            sum.hi()
        };
        let transfer = CMatrix::from_fn(outputs.len(), width, |i, w| {
            let i = outputs.start + i;
            c64::new(part(i, w, false), part(i, w, true))
        });
        Ok(linalg::singular_values(&transfer)?[0])
    }
}

/// Gauss and Jordan's elimination with partial pivoting of an augmented system; false when it is singular.
fn eliminate(rows: &mut [Vec<TwoFloat>]) -> bool {
    let size = rows.len();
    for column in 0..size {
        let pivot = (column..size)
            .max_by(|&i, &j| rows[i][column].hi().abs().total_cmp(&rows[j][column].hi().abs()))
            .unwrap_or(column);
        rows.swap(column, pivot);
        if rows[column][column].hi() == 0.0 || !rows[column][column].hi().is_finite() {
            return false;
        }
        let (above, rest) = rows.split_at_mut(column);
        let Some((head, below)) = rest.split_first_mut() else {
            return false;
        };
        let scale = TwoFloat::from(1.0) / head[column];
        for entry in &mut head[column..] {
            *entry *= scale;
        }
        for row in above.iter_mut().chain(below) {
            let factor = row[column];
            if factor.hi() == 0.0 {
                continue;
            }
            for (entry, own) in row[column..].iter_mut().zip(&head[column..]) {
                *entry -= factor * *own;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::from_rows;

    /// `ẋ₁ = x₂ + w`, `ẋ₂ = u`, `u = −K (x₁ + x₂) + (K − 1) x₁`: the two huge terms leave `−x₁ − K x₂`, a slow pole at −1/K.
    #[test]
    fn huge_gains_that_cancel_keep_their_difference() {
        let k = 2f64.powi(60);
        let plant = StateSpace::new(
            from_rows(&[vec![0.0, 1.0], vec![0.0, 0.0]]).unwrap(),
            from_rows(&[vec![1.0, 0.0], vec![0.0, 1.0]]).unwrap(),
            from_rows(&[vec![0.0, 1.0], vec![1.0, 1.0], vec![1.0, 0.0], vec![1.0, 0.0]]).unwrap(),
            Matrix::zeros(4, 2),
        )
        .unwrap();
        let gain = from_rows(&[vec![-k, k, -1.0]]).unwrap();
        let closed = Loop {
            plant: &plant,
            k: &gain,
        };
        // x₂ at zero frequency is −w, and x₁ = K w.
        assert_eq!(closed.gain(&(0..1), &(0..1), 0.0).unwrap(), 1.0);
        // Integrators beyond their corner: |x₂/w| = 1/|s² + K s + 1| at 1 rad/s is 1/K.
        let at = closed.gain(&(0..1), &(0..1), 1.0).unwrap();
        assert!((at * k - 1.0).abs() < 1e-15, "{at}");
    }

    #[test]
    fn ordinary_loop_agrees_with_doubles() {
        let plant = StateSpace::new(
            from_rows(&[vec![-1.0, 2.0], vec![0.3, -0.5]]).unwrap(),
            from_rows(&[vec![1.0, 0.2], vec![-0.4, 1.0]]).unwrap(),
            from_rows(&[vec![1.0, 0.5], vec![0.3, -1.0]]).unwrap(),
            from_rows(&[vec![0.1, -0.3], vec![0.2, 0.4]]).unwrap(),
        )
        .unwrap();
        let gain = from_rows(&[vec![-0.7]]).unwrap();
        let closed = crate::interconnect::lft_lower(&plant, &StateSpace::gain(gain.clone())).unwrap();
        for omega in [0.0, 0.3, 7.0, f64::INFINITY] {
            let expected = crate::norm::gain_at(&closed, omega).unwrap();
            let found = Loop {
                plant: &plant,
                k: &gain,
            }
            .gain(&(0..1), &(0..1), omega)
            .unwrap();
            assert!(
                (found - expected).abs() < 1e-13 * expected,
                "{omega}: {found} {expected}"
            );
        }
    }
}
