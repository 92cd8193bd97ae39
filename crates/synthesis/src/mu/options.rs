//! Options of a margin computation, and the destabilising perturbation that bounds the margin.

use crate::linalg::CMatrix;

/// Options of a margin computation.
#[derive(Debug, Clone, PartialEq)]
pub struct MarginOptions {
    /// Relative slack between the proved bound and the largest bound found on the grid: smaller needs more intervals.
    pub slack: f64,
    /// Maximum number of certified intervals.
    pub intervals: usize,
    /// Starts of the search for destabilising perturbations.
    pub starts: usize,
    /// Seed of that search.
    pub seed: u64,
}

impl Default for MarginOptions {
    fn default() -> Self {
        Self {
            slack: 1e-3,
            intervals: 3000,
            starts: 12,
            seed: 1,
        }
    }
}

/// A perturbation that makes the closed loop marginally stable.
#[derive(Debug, Clone)]
pub struct Destabilising {
    /// The perturbation Δ, closed as `w = Δ z`.
    pub delta: CMatrix,
    /// Its size: the largest norm of a block.
    pub size: f64,
    /// The frequency of the eigenvalue on the axis, rad/s.
    pub omega: f64,
}
