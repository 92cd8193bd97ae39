//! Errors of computations with matrices.

/// Errors of a dense matrix computation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinalgError {
    /// The given rows have different lengths.
    #[error("row {row} has {found} entries, the first row has {expected}")]
    Ragged {
        /// Index of the offending row.
        row: usize,
        /// Number of entries found there.
        found: usize,
        /// Number of entries of the first row.
        expected: usize,
    },
    /// An entry is a NaN or an infinity.
    #[error("entry ({row}, {column}) is {value}")]
    NotFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The value found.
        value: f64,
    },
    /// The eigenvalue or singular-value iteration did not converge.
    #[error("the {what} iteration of a {size} x {size} matrix did not converge")]
    NoConvergence {
        /// Which decomposition.
        what: &'static str,
        /// Dimension of the matrix.
        size: usize,
    },
    /// A matrix that must be inverted is singular to working precision.
    #[error("a {size} x {size} matrix is singular to working precision")]
    Singular {
        /// Dimension of the matrix.
        size: usize,
    },
    /// A matrix that must be positive definite is not.
    #[error("a {size} x {size} matrix is not positive definite (least eigenvalue {least:.6e})")]
    NotPositiveDefinite {
        /// Dimension of the matrix.
        size: usize,
        /// The least eigenvalue.
        least: f64,
    },
}
