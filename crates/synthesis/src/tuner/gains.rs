//! Parametrised static gains: from a vector of free numbers to the gain matrix, and gradients back.

use crate::linalg::{self, LinalgError, Matrix};

/// The shape a tunable gain must keep.
#[derive(Debug, Clone, PartialEq)]
pub enum GainKind {
    /// Any real p × q matrix: every entry free.
    Full {
        /// Rows p.
        rows: usize,
        /// Columns q.
        columns: usize,
    },
    /// A diagonal with positive entries, tuned in logarithms, so that 0.5 and 450 are equally far from their doubles.
    PositiveDiagonal(usize),
    /// Symmetric positive definite, block diagonal with blocks of these sizes; one block is a full matrix.
    PositiveDefinite(Vec<usize>),
}

impl GainKind {
    /// Rows and columns of the gain.
    pub fn shape(&self) -> (usize, usize) {
        match self {
            Self::Full { rows, columns } => (*rows, *columns),
            Self::PositiveDiagonal(n) => (*n, *n),
            Self::PositiveDefinite(sizes) => (sizes.iter().sum(), sizes.iter().sum()),
        }
    }

    /// Number of free parameters.
    pub fn parameters(&self) -> usize {
        match self {
            Self::Full { rows, columns } => rows * columns,
            Self::PositiveDiagonal(n) => *n,
            Self::PositiveDefinite(sizes) => sizes.iter().map(|n| n * (n + 1) / 2).sum(),
        }
    }
}

/// One tunable block of the controller gain matrix K (nu × ny), with its place in K and its start value.
///
/// In every model the block enters K as `left · X · right`, where the transforms belong to the model (identity when it
/// names none): this is how one constant X serves a scheduled gain such as `M(q)^½ X M(q)^½`.
#[derive(Debug, Clone, PartialEq)]
pub struct GainBlock {
    /// Name, for reports.
    pub name: String,
    /// Its structure.
    pub kind: GainKind,
    /// First row of K it occupies.
    pub row: usize,
    /// First column of K it occupies.
    pub column: usize,
    /// Start value X₀; positive definite where the kind asks for it.
    pub start: Matrix,
    /// For a full block, the size of one unit of a parameter (the others are scaled by their start value).
    pub unit: f64,
}

/// Errors of a gain block.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GainError {
    /// The start value has the wrong shape.
    #[error(
        "gain {name}: the start value is {rows} x {columns}, the structure needs {expected_rows} x {expected_columns}"
    )]
    Shape {
        /// Name of the gain.
        name: String,
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
        /// Rows needed.
        expected_rows: usize,
        /// Columns needed.
        expected_columns: usize,
    },
    /// The start value of a positive (definite) gain is not positive (definite).
    #[error("gain {name}: the start value is not positive definite (least eigenvalue {least:.6e})")]
    NotPositiveDefinite {
        /// Name of the gain.
        name: String,
        /// The least eigenvalue of its start value.
        least: f64,
    },
    /// The start value has entries outside the structure, or is not symmetric.
    #[error("gain {name}: entry ({row}, {column}) = {value} of the start value is outside its structure")]
    OutsideStructure {
        /// Name of the gain.
        name: String,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// The unit of a full block is not positive.
    #[error("gain {name}: the parameter unit is {unit}, it must be positive")]
    Unit {
        /// Name of the gain.
        name: String,
        /// The unit found.
        unit: f64,
    },
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// A part of a gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// All entries.
    All,
    /// A row.
    Row(usize),
    /// A column.
    Column(usize),
    /// An entry.
    Entry(usize, usize),
}

impl Part {
    fn contains(self, (row, column): (usize, usize)) -> bool {
        match self {
            Self::All => true,
            Self::Row(i) => i == row,
            Self::Column(j) => j == column,
            Self::Entry(i, j) => (i, j) == (row, column),
        }
    }
}

/// A validated block with the data of its parametrisation.
#[derive(Debug, Clone)]
pub(crate) struct Parametrised {
    pub(crate) block: GainBlock,
    /// Cholesky factor of the start value, for the positive definite kind.
    factor: Matrix,
}

impl Parametrised {
    pub(crate) fn new(block: GainBlock) -> Result<Self, GainError> {
        let (rows, columns) = block.kind.shape();
        let name = || block.name.clone();
        if (block.start.nrows(), block.start.ncols()) != (rows, columns) {
            return Err(GainError::Shape {
                name: name(),
                rows: block.start.nrows(),
                columns: block.start.ncols(),
                expected_rows: rows,
                expected_columns: columns,
            });
        }
        linalg::check_finite(&block.start)?;
        let outside = |allowed: &dyn Fn(usize, usize) -> bool| {
            for row in 0..rows {
                for column in 0..columns {
                    let value = block.start[(row, column)];
                    let asymmetric = (value - block.start[(column, row)]).abs() > 1e-9 * linalg::max_abs(&block.start);
                    if asymmetric || (!allowed(row, column) && value != 0.0) {
                        return Err(GainError::OutsideStructure {
                            name: name(),
                            row,
                            column,
                            value,
                        });
                    }
                }
            }
            Ok(())
        };
        let factor = match &block.kind {
            GainKind::Full { .. } => {
                if block.unit.is_nan() || block.unit <= 0.0 {
                    return Err(GainError::Unit {
                        name: name(),
                        unit: block.unit,
                    });
                }
                Matrix::zeros(0, 0)
            }
            GainKind::PositiveDiagonal(n) => {
                outside(&|i, j| i == j)?;
                let least = (0..*n).map(|i| block.start[(i, i)]).fold(f64::INFINITY, f64::min);
                if least <= 0.0 {
                    return Err(GainError::NotPositiveDefinite { name: name(), least });
                }
                Matrix::zeros(0, 0)
            }
            GainKind::PositiveDefinite(sizes) => {
                let owner: Vec<usize> = sizes.iter().enumerate().flat_map(|(b, n)| vec![b; *n]).collect();
                outside(&|i, j| owner[i] == owner[j])?;
                match linalg::cholesky(&block.start) {
                    Ok(factor) => factor,
                    Err(LinalgError::NotPositiveDefinite { least, .. }) => {
                        return Err(GainError::NotPositiveDefinite { name: name(), least });
                    }
                    Err(other) => return Err(other.into()),
                }
            }
        };
        Ok(Self { block, factor })
    }

    /// Whether a parameter is a logarithm or a factor of a positive gain (as opposed to an additive entry).
    pub(crate) fn relative(&self) -> bool {
        !matches!(self.block.kind, GainKind::Full { .. })
    }

    /// The gain X at the parameters `x`; `x = 0` gives the start value.
    pub(crate) fn value(&self, x: &[f64]) -> Matrix {
        let start = &self.block.start;
        match &self.block.kind {
            GainKind::Full { rows, columns } => Matrix::from_fn(*rows, *columns, |i, j| {
                start[(i, j)] + self.block.unit * x[i * columns + j]
            }),
            GainKind::PositiveDiagonal(n) => {
                Matrix::from_fn(
                    *n,
                    *n,
                    |i, j| if i == j { start[(i, i)] * libm::exp(x[i]) } else { 0.0 },
                )
            }
            GainKind::PositiveDefinite(_) => {
                let f = &self.factor * self.lower(x);
                &f * f.transpose()
            }
        }
    }

    /// Maps the gradient `g` of a function in X (same shape as X) to the gradient in the parameters.
    pub(crate) fn pull_back(&self, x: &[f64], g: &Matrix, out: &mut [f64]) {
        match &self.block.kind {
            GainKind::Full { rows, columns } => {
                for i in 0..*rows {
                    for j in 0..*columns {
                        out[i * columns + j] += self.block.unit * g[(i, j)];
                    }
                }
            }
            GainKind::PositiveDiagonal(n) => {
                for i in 0..*n {
                    out[i] += g[(i, i)] * self.block.start[(i, i)] * libm::exp(x[i]);
                }
            }
            GainKind::PositiveDefinite(sizes) => {
                // X = C L Lᵀ Cᵀ: dX = C (dL Lᵀ + L dLᵀ) Cᵀ, so the gradient in L is (H + Hᵀ) L with H = Cᵀ g C.
                let l = self.lower(x);
                let h = self.factor.transpose() * g * &self.factor;
                let in_l = (&h + h.transpose()) * &l;
                let mut at = 0;
                each_lower(sizes, |i, j| {
                    out[at] += if i == j { in_l[(i, i)] * l[(i, i)] } else { in_l[(i, j)] };
                    at += 1;
                });
            }
        }
    }

    /// The parts of the gain whose size can be changed alone.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let GainKind::Full { rows, columns } = &self.block.kind else {
            return vec![Part::All];
        };
        let (rows, columns) = (*rows, *columns);
        let mut parts = vec![Part::All];
        parts.extend((0..rows).map(Part::Row));
        parts.extend((0..columns).map(Part::Column));
        parts.extend((0..rows).flat_map(|i| (0..columns).map(move |j| Part::Entry(i, j))));
        parts
    }

    /// Changes the parameters `x` so that this part of the gain is multiplied by `factor` (positive).
    pub(crate) fn scale(&self, x: &mut [f64], part: Part, factor: f64) {
        match &self.block.kind {
            GainKind::Full { columns, .. } => {
                let value = self.value(x);
                for (at, x) in x.iter_mut().enumerate() {
                    let place = (at / columns, at % columns);
                    if part.contains(place) {
                        *x = (factor * value[place] - self.block.start[place]) / self.block.unit;
                    }
                }
            }
            GainKind::PositiveDiagonal(_) => x.iter_mut().for_each(|x| *x += libm::log(factor)),
            GainKind::PositiveDefinite(sizes) => {
                let mut at = 0;
                each_lower(sizes, |i, j| {
                    if i == j {
                        x[at] += 0.5 * libm::log(factor);
                    } else {
                        x[at] *= factor.sqrt();
                    }
                    at += 1;
                });
            }
        }
    }

    /// The lower triangular factor L(x), block diagonal, with exponentials on the diagonal; L(0) = I.
    fn lower(&self, x: &[f64]) -> Matrix {
        let GainKind::PositiveDefinite(sizes) = &self.block.kind else {
            return Matrix::zeros(0, 0);
        };
        let n = sizes.iter().sum();
        let mut l = Matrix::zeros(n, n);
        let mut at = 0;
        each_lower(sizes, |i, j| {
            l[(i, j)] = if i == j { libm::exp(x[at]) } else { x[at] };
            at += 1;
        });
        l
    }
}

/// Visits the lower triangle of every diagonal block, row by row.
fn each_lower(sizes: &[usize], mut visit: impl FnMut(usize, usize)) {
    let mut first = 0;
    for n in sizes {
        for i in 0..*n {
            for j in 0..=i {
                visit(first + i, first + j);
            }
        }
        first += n;
    }
}
