//! Linear systems by LU factorisation with partial pivoting, in blocks of columns, so that most of the work is in products.

use nalgebra::DMatrix;

use super::matrix::{Dense, Scalar};

/// Columns of a block.
const BLOCK: usize = 24;

/// Solves `a x = b`; `None` where a pivot is zero or not finite.
pub(super) fn solve<T: Scalar>(a: &Dense<T>, b: &Dense<T>) -> Option<Dense<T>> {
    let (mut a, mut x) = (a.0.clone(), b.0.clone());
    let n = a.nrows();
    for first in (0..n).step_by(BLOCK) {
        let next = (first + BLOCK).min(n);
        factor_panel(&mut a, &mut x, first, next)?;
        for column in next..n {
            substitute_forward(&mut a, None, first, next, column);
        }
        for column in 0..x.ncols() {
            substitute_forward(&mut a, Some(&mut x), first, next, column);
        }
        if next < n {
            let below = block(&a, next..n, first..next);
            let beside = block(&a, first..next, next..n);
            let update = T::product(&below, &beside);
            let mut rest = a.view_mut((next, next), (n - next, n - next));
            rest -= update;
            let update = T::product(&below, &block(&x, first..next, 0..x.ncols()));
            let mut rest = x.rows_mut(next, n - next);
            rest -= update;
        }
    }
    for first in (0..n).step_by(BLOCK).rev() {
        let next = (first + BLOCK).min(n);
        for column in 0..x.ncols() {
            substitute_back(&a, &mut x, first, next, column);
        }
        if first > 0 {
            let update = T::product(&block(&a, 0..first, first..next), &block(&x, first..next, 0..x.ncols()));
            let mut rest = x.rows_mut(0, first);
            rest -= update;
        }
    }
    Some(Dense(x))
}

fn block<T: Scalar>(m: &DMatrix<T>, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> DMatrix<T> {
    m.view((rows.start, columns.start), (rows.len(), columns.len()))
        .into_owned()
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

/// Solves with the unit lower triangle of the block for a column of `x`, or of `a` itself.
fn substitute_forward<T: Scalar>(
    a: &mut DMatrix<T>,
    x: Option<&mut DMatrix<T>>,
    first: usize,
    next: usize,
    column: usize,
) {
    let n = a.nrows();
    let (lower, target) = match x {
        Some(x) => (a.as_slice(), &mut x.as_mut_slice()[column * n..]),
        None => {
            let (lower, rest) = a.as_mut_slice().split_at_mut(column * n);
            (&*lower, rest)
        }
    };
    for j in first..next {
        subtract_multiple(&mut target[..next], &lower[j * n..j * n + next], j);
    }
}

/// Solves with the upper triangle of the block for a column of `x`.
fn substitute_back<T: Scalar>(a: &DMatrix<T>, x: &mut DMatrix<T>, first: usize, next: usize, column: usize) {
    let n = a.nrows();
    let upper = a.as_slice();
    let target = &mut x.as_mut_slice()[column * n..(column + 1) * n];
    for j in (first..next).rev() {
        target[j] /= upper[j * n + j];
        let factor = target[j];
        for (entry, own) in target[first..j].iter_mut().zip(&upper[j * n + first..j * n + j]) {
            *entry -= *own * factor;
        }
    }
}
