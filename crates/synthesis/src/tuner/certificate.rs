//! Evidence that a point is a local optimum.

use super::objective::{Objective, Piece};
use super::qp::{least_in_hull, length};
use crate::linalg::LinalgError;
use crate::rng::Rng;

/// Evidence of local optimality: the smallest convex combination of the gradients of ln γ in the tuner's parameters, over
/// the pieces within `depth` of the maximum at the result and at points `radius` around it. A length of 0.01 means that to
/// first order no unit step of the parameters (a factor e of a positive gain) gains more than about one per cent.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// Length of that smallest element.
    pub length: f64,
    /// The largest length among the gradients it combines, for comparison.
    pub steepest: f64,
    /// Number of gradients.
    pub gradients: usize,
    /// Number of them with a weight above 1e-4.
    pub active: usize,
    /// Radius of the neighbourhood in parameter space.
    pub radius: f64,
    /// Relative distance below the maximum within which a piece counts.
    pub depth: f64,
}

impl Certificate {
    /// No evidence.
    pub(crate) const NONE: Self = Self {
        length: f64::INFINITY,
        steepest: 0.0,
        gradients: 0,
        active: 0,
        radius: 0.0,
        depth: 0.0,
    };
}

/// Collects active gradients at `x` and at a few points around it, for a few radii, and keeps the tightest evidence.
pub(super) fn certify(objective: &mut Objective<'_>, x: &[f64], seed: u64) -> Result<Certificate, LinalgError> {
    let mut best: Option<Certificate> = None;
    for (radius, depth) in [(1e-4, 1e-3), (1e-3, 5e-3), (1e-2, 2e-2)] {
        let (value, pieces) = objective.pieces(x, 1.0 - depth)?;
        let mut gradients: Vec<Vec<f64>> = pieces.iter().map(|p| p.logarithm().gradient).collect();
        let mut rng = Rng::new(seed, u64::MAX);
        for _ in 0..x.len().clamp(4, 30) {
            let step: Vec<f64> = x.iter().map(|_| rng.normal()).collect();
            let factor = radius / length(&step);
            let near: Vec<f64> = x.iter().zip(&step).map(|(a, s)| a + factor * s).collect();
            let (at, pieces) = objective.pieces(&near, 1.0 - depth)?;
            if at.gamma.is_finite() {
                let close = |p: &&Piece| (p.value - value.gamma).abs() <= depth * value.gamma;
                gradients.extend(pieces.iter().filter(close).map(|p| p.logarithm().gradient));
            }
        }
        gradients.truncate(GRADIENTS_MAX);
        if gradients.is_empty() {
            continue;
        }
        let (lambda, least) = least_in_hull(&gradients);
        let found = Certificate {
            length: length(&least),
            steepest: gradients.iter().map(|g| length(g)).fold(0.0, f64::max),
            gradients: gradients.len(),
            active: lambda.iter().filter(|l| **l > 1e-4).count(),
            radius,
            depth,
        };
        if found.length <= LENGTH_SUFFICIENT {
            return Ok(found);
        }
        // A wider neighbourhood is preferred only if it is much better.
        if best.as_ref().is_none_or(|b| found.length < 0.2 * b.length) {
            best = Some(found);
        }
    }
    Ok(best.unwrap_or(Certificate::NONE))
}

/// A certificate that needs no wider neighbourhood.
const LENGTH_SUFFICIENT: f64 = 1e-3;

/// Maximum number of gradients of a certificate: the cost of the quadratic program grows with the third power of their number.
const GRADIENTS_MAX: usize = 400;
