//! A point whose score is wanted.

/// A point to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Which point, from 0, over all levels.
    pub number: usize,
    /// Its level, from 0.
    pub level: usize,
    /// The point that it is a step from; none in the first level.
    pub parent: Option<usize>,
    /// Its coordinates in (0, 1).
    pub u: Vec<f64>,
}
