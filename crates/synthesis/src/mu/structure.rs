//! Block-diagonal uncertainty.

use crate::linalg::{self, CMatrix, LinalgError, c64};

/// One block of Δ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Block {
    /// A real parameter δ ∈ [−1, 1], repeated: δ I.
    Real(usize),
    /// A complex number |δ| ≤ 1, repeated: δ I.
    Complex(usize),
    /// A full complex matrix of norm ≤ 1 with this many rows and columns.
    Full {
        /// Rows: inputs of M that the block drives.
        rows: usize,
        /// Columns: outputs of M that drive the block.
        columns: usize,
    },
}

impl Block {
    /// Rows of the block.
    pub fn rows(&self) -> usize {
        match *self {
            Self::Real(n) | Self::Complex(n) => n,
            Self::Full { rows, .. } => rows,
        }
    }

    /// Columns of the block.
    pub fn columns(&self) -> usize {
        match *self {
            Self::Real(n) | Self::Complex(n) => n,
            Self::Full { columns, .. } => columns,
        }
    }
}

/// Errors of computing a structured singular value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MuError {
    /// The blocks do not fit the matrix.
    #[error(
        "the blocks are {block_rows} x {block_columns} together, which needs a {block_columns} x {block_rows} matrix; this one is {rows} x {columns}"
    )]
    Misfit {
        /// Rows of Δ.
        block_rows: usize,
        /// Columns of Δ.
        block_columns: usize,
        /// Rows of M.
        rows: usize,
        /// Columns of M.
        columns: usize,
    },
    /// A block without rows or columns, or no block at all.
    #[error("the uncertainty has an empty block")]
    Empty,
    /// The nominal system is not stable: no margin exists.
    #[error("the nominal system is not stable (spectral abscissa {0:.6e})")]
    Unstable(f64),
    /// The frequency axis could not be covered within the limit.
    #[error(
        "the frequency axis could not be covered in {steps} steps: nothing is guaranteed between {from:.6e} and {to:.6e} rad/s"
    )]
    NotCovered {
        /// Steps taken.
        steps: usize,
        /// Lower end of the first gap.
        from: f64,
        /// Its upper end.
        to: f64,
    },
    /// A proof and a perturbation that cannot both be right: a defect of this program.
    #[error(
        "a perturbation of size {destabilising:.9} destabilises although sizes up to {guaranteed:.9} were proved harmless: \
         this is a defect of the analysis, and neither number can be trusted"
    )]
    Contradiction {
        /// The proved margin.
        guaranteed: f64,
        /// The size of the perturbation found.
        destabilising: f64,
    },
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// The block structure of Δ: blocks in order along the diagonal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Structure {
    blocks: Vec<Block>,
}

impl Structure {
    /// A structure from its blocks.
    ///
    /// # Errors
    /// An empty block or list.
    pub fn new(blocks: Vec<Block>) -> Result<Self, MuError> {
        if blocks.is_empty() || blocks.iter().any(|b| b.rows() == 0 || b.columns() == 0) {
            return Err(MuError::Empty);
        }
        Ok(Self { blocks })
    }

    /// The blocks.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Rows of Δ, which is the number of columns of M.
    pub fn rows(&self) -> usize {
        self.blocks.iter().map(Block::rows).sum()
    }

    /// Columns of Δ, which is the number of rows of M.
    pub fn columns(&self) -> usize {
        self.blocks.iter().map(Block::columns).sum()
    }

    pub(crate) fn check(&self, rows: usize, columns: usize) -> Result<(), MuError> {
        if rows == self.columns() && columns == self.rows() {
            return Ok(());
        }
        Err(MuError::Misfit {
            block_rows: self.rows(),
            block_columns: self.columns(),
            rows,
            columns,
        })
    }

    /// Every block with the first row and column it occupies in Δ.
    pub(crate) fn blocks_with_offsets(&self) -> impl Iterator<Item = (Block, usize, usize)> + '_ {
        let (mut row, mut column) = (0, 0);
        self.blocks.iter().map(move |b| {
            let at = (*b, row, column);
            row += b.rows();
            column += b.columns();
            at
        })
    }

    /// Number of free real numbers in the scalings D and G.
    pub(crate) fn scalings(&self) -> usize {
        let count = |b: &Block| match *b {
            Block::Real(n) => 2 * n * n,
            Block::Complex(n) => n * n,
            Block::Full { .. } => 1,
        };
        self.blocks.iter().map(count).sum()
    }

    /// Whether every block is real.
    pub(crate) fn all_real(&self) -> bool {
        self.blocks.iter().all(|b| matches!(b, Block::Real(_)))
    }

    /// The Δ of unit norm in this structure that maximises `Re(row · Δ · column)`.
    pub(crate) fn maximising_delta(&self, row: &[c64], column: &[c64]) -> CMatrix {
        let mut delta = CMatrix::zeros(self.rows(), self.columns());
        for (block, r, c) in self.blocks_with_offsets() {
            match block {
                Block::Real(n) | Block::Complex(n) => {
                    let inner: c64 = (0..n).map(|i| row[r + i] * column[c + i]).sum();
                    let value = if matches!(block, Block::Real(_)) {
                        c64::new(if inner.re >= 0.0 { 1.0 } else { -1.0 }, 0.0)
                    } else if inner.norm() > 0.0 {
                        inner.conj() / inner.norm()
                    } else {
                        c64::new(1.0, 0.0)
                    };
                    for i in 0..n {
                        delta[(r + i, c + i)] = value;
                    }
                }
                Block::Full { rows, columns } => {
                    let nr = (0..rows).map(|i| row[r + i].norm_sqr()).sum::<f64>().sqrt();
                    let nc = (0..columns).map(|i| column[c + i].norm_sqr()).sum::<f64>().sqrt();
                    for i in 0..rows {
                        for j in 0..columns {
                            delta[(r + i, c + j)] = if nr > 0.0 && nc > 0.0 {
                                row[r + i].conj() * column[c + j].conj() / (nr * nc)
                            } else {
                                c64::new(f64::from(u8::from(i == 0 && j == 0)), 0.0)
                            };
                        }
                    }
                }
            }
        }
        delta
    }

    /// The largest norm of the blocks of a Δ of this structure.
    pub fn norm(&self, delta: &CMatrix) -> Result<f64, LinalgError> {
        let mut largest = 0.0f64;
        for (block, r, c) in self.blocks_with_offsets() {
            let part = CMatrix::from_fn(block.rows(), block.columns(), |i, j| delta[(r + i, c + j)]);
            largest = largest.max(linalg::singular_values(&part)?[0]);
        }
        Ok(largest)
    }

    /// Whether `delta` has this structure, to `tolerance` relative to its norm.
    pub fn contains(&self, delta: &CMatrix, tolerance: f64) -> bool {
        if delta.nrows() != self.rows() || delta.ncols() != self.columns() {
            return false;
        }
        let mut inside = CMatrix::zeros(self.rows(), self.columns());
        for (block, r, c) in self.blocks_with_offsets() {
            for i in 0..block.rows() {
                for j in 0..block.columns() {
                    inside[(r + i, c + j)] = match block {
                        Block::Real(_) if i == j => c64::new(delta[(r, c)].re, 0.0),
                        Block::Complex(_) if i == j => delta[(r, c)],
                        Block::Full { .. } => delta[(r + i, c + j)],
                        _ => c64::new(0.0, 0.0),
                    };
                }
            }
        }
        let scale = self.norm(delta).unwrap_or(f64::INFINITY);
        let entries = (0..delta.nrows()).flat_map(|i| (0..delta.ncols()).map(move |j| (i, j)));
        entries
            .into_iter()
            .all(|(i, j)| (delta[(i, j)] - inside[(i, j)]).norm() <= tolerance * scale)
    }
}
