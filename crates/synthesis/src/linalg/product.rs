//! Products of dense matrices.
//!
//! An entry is one chain of fused multiply-adds in the order of the inner index, whatever the size of the tile it lies in, so
//! a product has the same bits on every processor. The tiles stay in registers: nalgebra's own product takes ten times as long
//! at the sizes of this crate, and with its fast kernels the bits depend on the processor.

use multibody::{F64x4, Real};
use nalgebra::DMatrix;
use num_complex::Complex64;

/// Doubles of a vector.
const LANES: usize = 4;
/// Vectors of rows, and columns, of the largest tile: its sums take three quarters of the registers.
const TILE_VECTORS: usize = 3;
const TILE_COLUMNS: usize = 4;

/// `a b` of real matrices.
///
/// # Panics
/// When the columns of `a` are not as many as the rows of `b`.
pub(super) fn real(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    assert_eq!(a.ncols(), b.nrows(), "shapes of a product do not fit");
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    let operands = Operands {
        a: a.as_slice(),
        b: b.as_slice(),
        rows: a.nrows(),
        inner: a.ncols(),
    };
    let columns = b.ncols();
    let out_entries = out.as_mut_slice();
    let mut column = 0;
    while column + TILE_COLUMNS <= columns {
        operands.columns::<TILE_COLUMNS>(column, out_entries);
        column += TILE_COLUMNS;
    }
    while column < columns {
        operands.columns::<1>(column, out_entries);
        column += 1;
    }
    out
}

/// `a b` of complex matrices.
///
/// The parts of an entry of `a` are adjacent in a column, so `a` is a real matrix with twice the rows; with the parts of `b` as
/// adjacent columns, one real product has the four products of parts that each complex product is made of.
///
/// # Panics
/// When the columns of `a` are not as many as the rows of `b`.
pub(super) fn complex(a: &DMatrix<Complex64>, b: &DMatrix<Complex64>) -> DMatrix<Complex64> {
    let parts = |x: &Complex64| [x.re, x.im];
    let left = DMatrix::from_iterator(2 * a.nrows(), a.ncols(), a.iter().flat_map(parts));
    let right = DMatrix::from_fn(b.nrows(), 2 * b.ncols(), |i, j| {
        let entry = b[(i, j / 2)];
        if j % 2 == 0 { entry.re } else { entry.im }
    });
    let all = real(&left, &right);
    DMatrix::from_fn(a.nrows(), b.ncols(), |i, j| {
        Complex64::new(
            all[(2 * i, 2 * j)] - all[(2 * i + 1, 2 * j + 1)],
            all[(2 * i + 1, 2 * j)] + all[(2 * i, 2 * j + 1)],
        )
    })
}

/// `mᵀ m` of a real matrix, half of it computed.
///
/// An entry is the sum of four chains of fused multiply-adds, each over every fourth row, and of the remaining rows in order.
pub(super) fn gram(m: &DMatrix<f64>) -> DMatrix<f64> {
    const TILE: usize = 3;
    let (rows, n) = m.shape();
    let entries = m.as_slice();
    let mut out = DMatrix::zeros(n, n);
    for first in (0..n).step_by(TILE) {
        for second in (first..n).step_by(TILE) {
            // A tile at the edge repeats the last column.
            let columns = |from: usize| -> [&[f64]; TILE] {
                std::array::from_fn(|k| {
                    let column = (from + k).min(n - 1);
                    &entries[column * rows..(column + 1) * rows]
                })
            };
            let sums = products_of_columns(columns(first), columns(second));
            for (i, line) in sums.iter().enumerate().take(n - first) {
                for (j, &sum) in line.iter().enumerate().take(n - second) {
                    out[(first + i, second + j)] = sum;
                    out[(second + j, first + i)] = sum;
                }
            }
        }
    }
    out
}

/// The first so many vectors of a column.
fn in_lanes(column: &[f64], chunks: usize) -> &[[f64; LANES]] {
    &column.as_chunks().0[..chunks]
}

/// The scalar products of each of some columns with each of others.
fn products_of_columns<const N: usize>(left: [&[f64]; N], right: [&[f64]; N]) -> [[f64; N]; N] {
    let chunks = left[0].len() / LANES;
    let (left_lanes, right_lanes) = (
        left.map(|one| in_lanes(one, chunks)),
        right.map(|one| in_lanes(one, chunks)),
    );
    let mut sums = [[F64x4::of(0.0); N]; N];
    for at in 0..chunks {
        let right: [F64x4; N] = std::array::from_fn(|j| F64x4::new(right_lanes[j][at]));
        for i in 0..N {
            let left = F64x4::new(left_lanes[i][at]);
            for j in 0..N {
                sums[i][j] = left.mul_add(right[j], sums[i][j]);
            }
        }
    }
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let [a, b, c, d] = sums[i][j].to_array();
            let rest = left[i].iter().zip(right[j]).skip(chunks * LANES);
            rest.fold((a + b) + (c + d), |sum, (x, y)| x.mul_add(*y, sum))
        })
    })
}

/// The entries of both operands, by columns.
struct Operands<'a> {
    a: &'a [f64],
    b: &'a [f64],
    rows: usize,
    inner: usize,
}

impl Operands<'_> {
    /// Computes `COLUMNS` columns of the product from `column` on.
    fn columns<const COLUMNS: usize>(&self, column: usize, out: &mut [f64]) {
        let mut row = 0;
        while row + TILE_VECTORS * LANES <= self.rows {
            self.tile::<TILE_VECTORS, COLUMNS>(row, column, out);
            row += TILE_VECTORS * LANES;
        }
        while row + LANES <= self.rows {
            self.tile::<1, COLUMNS>(row, column, out);
            row += LANES;
        }
        for row in row..self.rows {
            for column in column..column + COLUMNS {
                let factors = &self.b[column * self.inner..(column + 1) * self.inner];
                let entries = self.a.iter().skip(row).step_by(self.rows);
                out[column * self.rows + row] = entries
                    .zip(factors)
                    .fold(0.0, |sum, (entry, factor)| entry.mul_add(*factor, sum));
            }
        }
    }

    fn tile<const VECTORS: usize, const COLUMNS: usize>(&self, row: usize, column: usize, out: &mut [f64]) {
        let mut sums = [[F64x4::of(0.0); VECTORS]; COLUMNS];
        let factors: [&[f64]; COLUMNS] =
            std::array::from_fn(|j| &self.b[(column + j) * self.inner..(column + j + 1) * self.inner]);
        for k in 0..self.inner {
            let first = k * self.rows + row;
            let (chunks, _) = self.a[first..first + VECTORS * LANES].as_chunks::<LANES>();
            let entries: [F64x4; VECTORS] = std::array::from_fn(|i| F64x4::new(chunks[i]));
            for (sums, factors) in sums.iter_mut().zip(&factors) {
                let factor = F64x4::of(factors[k]);
                for (sum, entry) in sums.iter_mut().zip(&entries) {
                    *sum = entry.mul_add(factor, *sum);
                }
            }
        }
        for (j, sums) in sums.iter().enumerate() {
            let first = (column + j) * self.rows + row;
            let (chunks, _) = out[first..first + VECTORS * LANES].as_chunks_mut::<LANES>();
            for (chunk, sum) in chunks.iter_mut().zip(sums) {
                *chunk = sum.to_array();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    /// Every remainder of rows and columns against the tiles, and no inner index at all.
    #[test]
    fn product_of_any_shape_has_bits_of_its_definition() {
        let mut rng = Rng::new(3, 0);
        for (rows, inner, columns) in [
            (1, 1, 1),
            (8, 5, 4),
            (13, 7, 6),
            (15, 1, 3),
            (3, 0, 2),
            (0, 3, 2),
            (21, 40, 9),
        ] {
            let a = DMatrix::from_fn(rows, inner, |_, _| rng.normal());
            let b = DMatrix::from_fn(inner, columns, |_, _| rng.normal());
            let expected = DMatrix::from_fn(rows, columns, |i, j| {
                (0..inner).fold(0.0, |sum, k| a[(i, k)].mul_add(b[(k, j)], sum))
            });
            assert_eq!(real(&a, &b), expected, "{rows} x {inner} x {columns}");
        }
    }

    #[test]
    fn gram_matrix_is_product_with_transpose() {
        let mut rng = Rng::new(5, 0);
        for (rows, columns) in [(1, 1), (4, 3), (7, 5), (0, 2), (30, 8), (3, 0)] {
            let m = DMatrix::from_fn(rows, columns, |_, _| rng.normal());
            let (found, expected) = (gram(&m), real(&m.transpose(), &m));
            assert_eq!(found, found.transpose());
            assert!((found - expected).amax() < 1e-13, "{rows} x {columns}");
        }
    }

    #[test]
    fn complex_product_is_sum_of_products_of_entries() {
        let mut rng = Rng::new(4, 0);
        let mut matrix =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| Complex64::new(rng.normal(), rng.normal()));
        let (a, b) = (matrix(5, 11), matrix(11, 3));
        let found = complex(&a, &b);
        for ((i, j), entry) in (0..5)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|at| (at, found[at]))
        {
            let expected: Complex64 = (0..11).map(|k| a[(i, k)] * b[(k, j)]).sum();
            assert!((entry - expected).norm() < 1e-13, "({i}, {j}): {entry} {expected}");
        }
    }
}
