//! Candidate: a point to be evaluated.

/// A point to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Number of the point, from 0, over all levels.
    pub number: usize,
    /// Its level, from 0.
    pub level: usize,
    /// The point from which the step starts; none in the first level.
    pub parent: Option<usize>,
    /// Its coordinates in (0, 1).
    pub u: Vec<f64>,
}
