//! A dense matrix and its arithmetic.

use std::fmt;
use std::ops::{Add, AddAssign, Index, IndexMut, Mul, Sub};

use nalgebra::{ComplexField, DMatrix};

use super::product;

/// A complex number, `re + j im`.
#[allow(non_camel_case_types)]
pub type c64 = num_complex::Complex64;
/// A dense real matrix; `m[(row, column)]`.
pub type Matrix = Dense<f64>;
/// A dense complex matrix; `m[(row, column)]`.
pub type CMatrix = Dense<c64>;

/// A number that matrices are made of: `f64` or [`c64`].
pub trait Scalar: ComplexField<RealField = f64> + Copy {
    /// `a b`, for shapes that fit.
    #[doc(hidden)]
    fn product(a: &DMatrix<Self>, b: &DMatrix<Self>) -> DMatrix<Self>;
}

impl Scalar for f64 {
    fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
        product::real(a, b)
    }
}

impl Scalar for c64 {
    fn product(a: &DMatrix<c64>, b: &DMatrix<c64>) -> DMatrix<c64> {
        product::complex(a, b)
    }
}

/// A dense matrix, stored by columns; `m[(row, column)]`. Operators and blocks panic where shapes do not fit.
#[derive(Clone, PartialEq)]
pub struct Dense<T: Scalar>(pub(super) DMatrix<T>);

impl<T: Scalar> Dense<T> {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self(DMatrix::zeros(rows, columns))
    }

    /// Ones on the diagonal, zeros elsewhere.
    pub fn identity(rows: usize, columns: usize) -> Self {
        Self(DMatrix::identity(rows, columns))
    }

    /// The matrix whose entry (i, j) is `entry(i, j)`.
    pub fn from_fn(rows: usize, columns: usize, entry: impl FnMut(usize, usize) -> T) -> Self {
        Self(DMatrix::from_fn(rows, columns, entry))
    }

    /// Number of rows.
    pub fn nrows(&self) -> usize {
        self.0.nrows()
    }

    /// Number of columns.
    pub fn ncols(&self) -> usize {
        self.0.ncols()
    }

    /// The transpose, without conjugation.
    pub fn transpose(&self) -> Self {
        Self(self.0.transpose())
    }

    /// The entries of a column.
    pub fn column_mut(&mut self, column: usize) -> &mut [T] {
        let rows = self.nrows();
        &mut self.0.as_mut_slice()[column * rows..(column + 1) * rows]
    }

    /// A copy of rows `row..row + height`, columns `column..column + width`.
    pub fn block(&self, row: usize, column: usize, height: usize, width: usize) -> Self {
        Self(self.0.view((row, column), (height, width)).into_owned())
    }

    /// Writes `block` with its upper left corner at (`row`, `column`).
    pub fn set_block(&mut self, row: usize, column: usize, block: &Self) {
        self.0.view_mut((row, column), block.0.shape()).copy_from(&block.0);
    }

    /// Whether no entry is a NaN or an infinity.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
}

impl Dense<f64> {
    /// `mᵀ m`.
    pub fn gram(&self) -> Self {
        Self(product::gram(&self.0))
    }
}

impl<T: Scalar> fmt::Debug for Dense<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = (0..self.nrows()).map(|i| (0..self.ncols()).map(move |j| self[(i, j)]));
        f.debug_list().entries(rows.map(Iterator::collect::<Vec<T>>)).finish()
    }
}

impl<T: Scalar> Index<(usize, usize)> for Dense<T> {
    type Output = T;

    fn index(&self, at: (usize, usize)) -> &T {
        &self.0[at]
    }
}

impl<T: Scalar> IndexMut<(usize, usize)> for Dense<T> {
    fn index_mut(&mut self, at: (usize, usize)) -> &mut T {
        &mut self.0[at]
    }
}

/// The four combinations of owned and borrowed operands of an operator.
macro_rules! operator {
    ($Trait:ident, $method:ident, |$a:ident, $b:ident| $result:expr) => {
        impl<T: Scalar> $Trait<&Dense<T>> for &Dense<T> {
            type Output = Dense<T>;

            fn $method(self, other: &Dense<T>) -> Dense<T> {
                let ($a, $b) = (&self.0, &other.0);
                Dense($result)
            }
        }

        impl<T: Scalar> $Trait<Dense<T>> for &Dense<T> {
            type Output = Dense<T>;

            fn $method(self, other: Dense<T>) -> Dense<T> {
                self.$method(&other)
            }
        }

        impl<T: Scalar> $Trait<&Dense<T>> for Dense<T> {
            type Output = Dense<T>;

            fn $method(self, other: &Dense<T>) -> Dense<T> {
                (&self).$method(other)
            }
        }

        impl<T: Scalar> $Trait<Dense<T>> for Dense<T> {
            type Output = Dense<T>;

            fn $method(self, other: Dense<T>) -> Dense<T> {
                (&self).$method(&other)
            }
        }
    };
}

operator!(Add, add, |a, b| a + b);
operator!(Sub, sub, |a, b| a - b);
operator!(Mul, mul, |a, b| T::product(a, b));

impl<T: Scalar> AddAssign for Dense<T> {
    fn add_assign(&mut self, other: Dense<T>) {
        self.0 += other.0;
    }
}

impl<T: Scalar> Mul<T> for &Dense<T> {
    type Output = Dense<T>;

    fn mul(self, factor: T) -> Dense<T> {
        Dense(&self.0 * factor)
    }
}

impl<T: Scalar> Mul<T> for Dense<T> {
    type Output = Dense<T>;

    fn mul(self, factor: T) -> Dense<T> {
        Dense(self.0 * factor)
    }
}
