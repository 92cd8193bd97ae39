//! Linear systems by LU factorisation with partial pivoting, in blocks of columns, so that most of the work is in products.

use nalgebra::DMatrix;

use super::matrix::{Dense, Scalar};

/// Columns of a block.
const BLOCK: usize = 24;

/// Solves `a x = b`; `None` where a pivot is zero or not finite.
pub(super) fn solve<T: Scalar>(a: &Dense<T>, b: &Dense<T>) -> Option<Dense<T>> {
    let (mut a, mut x) = (a.clone(), b.clone());
    let (n, columns) = (a.nrows(), x.ncols());
    for first in (0..n).step_by(BLOCK) {
        let next = (first + BLOCK).min(n);
        factor_panel(&mut a.0, &mut x.0, first, next)?;
        for column in next..n {
            let (lower, rest) = a.0.as_mut_slice().split_at_mut(column * n);
            substitute_forward(lower, &mut rest[..n], first, next);
        }
        for column in 0..columns {
            substitute_forward(a.0.as_slice(), x.column_mut(column), first, next);
        }
        if next < n {
            let (height, width) = (n - next, next - first);
            let below = a.block(next, first, height, width);
            let update = &below * a.block(first, next, width, height);
            let mut rest = a.0.view_mut((next, next), (height, height));
            rest -= update.0;
            let update = below * x.block(first, 0, width, columns);
            let mut rest = x.0.rows_mut(next, height);
            rest -= update.0;
        }
    }
    for first in (0..n).step_by(BLOCK).rev() {
        let next = (first + BLOCK).min(n);
        for column in 0..columns {
            substitute_back(a.0.as_slice(), x.column_mut(column), first, next);
        }
        if first > 0 {
            let update = a.block(0, first, first, next - first) * x.block(first, 0, next - first, columns);
            let mut rest = x.0.rows_mut(0, first);
            rest -= update.0;
        }
    }
    Some(x)
}

/// Factors the columns `first..next` from row `first` on; its exchanges of rows reach all of `a` and `x`.
fn factor_panel<T: Scalar>(a: &mut DMatrix<T>, x: &mut DMatrix<T>, first: usize, next: usize) -> Option<()> {
    let n = a.nrows();
    for j in first..next {
        let mut pivot = j;
        for i in j + 1..n {
            if a[(i, j)].norm1() > a[(pivot, j)].norm1() {
                pivot = i;
            }
        }
        let size = a[(pivot, j)].norm1();
        if size == 0.0 || !size.is_finite() {
            return None;
        }
        if pivot != j {
            a.swap_rows(pivot, j);
            x.swap_rows(pivot, j);
        }
        let reciprocal = T::one() / a[(j, j)];
        let entries = a.as_mut_slice();
        entries[j * n + j + 1..(j + 1) * n]
            .iter_mut()
            .for_each(|entry| *entry *= reciprocal);
        for column in j + 1..next {
            let (done, rest) = entries.split_at_mut(column * n);
            subtract_multiple(&mut rest[..n], &done[j * n..(j + 1) * n], j);
        }
    }
    Some(())
}

/// Subtracts a multiple of the factored column, below row `j`, from a column: what entry `j` of the latter says.
fn subtract_multiple<T: Scalar>(column: &mut [T], factored: &[T], j: usize) {
    let factor = column[j];
    if factor == T::zero() {
        return;
    }
    for (entry, own) in column[j + 1..].iter_mut().zip(&factored[j + 1..]) {
        *entry -= *own * factor;
    }
}

/// Solves with the unit lower triangle of the block, whose columns are in `lower`, for a column.
fn substitute_forward<T: Scalar>(lower: &[T], target: &mut [T], first: usize, next: usize) {
    let n = target.len();
    for j in first..next {
        subtract_multiple(&mut target[..next], &lower[j * n..j * n + next], j);
    }
}

/// Solves with the upper triangle of the block, whose columns are in `upper`, for a column.
fn substitute_back<T: Scalar>(upper: &[T], target: &mut [T], first: usize, next: usize) {
    let n = target.len();
    for j in (first..next).rev() {
        target[j] /= upper[j * n + j];
        let factor = target[j];
        for (entry, own) in target[first..j].iter_mut().zip(&upper[j * n + first..j * n + j]) {
            *entry -= *own * factor;
        }
    }
}
