//! Multivariate distributions: correlated normal numbers, and directions.

use std::f64::consts::TAU;

use super::invalid::{InvalidParameter, invalid};
use super::normal::quantile;

/// A multivariate normal distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlated {
    mean: Vec<f64>,
    /// The Cholesky factor (lower triangle) of the covariance, row by row.
    cholesky: Vec<Vec<f64>>,
}

impl Correlated {
    /// Builds it from means, standard deviations and the correlation matrix, which has ones on its diagonal; `None`: independent numbers.
    ///
    /// # Errors
    /// A matrix of the wrong size, or one that is no correlation matrix; negative deviations. A deviation of zero gives a constant.
    pub fn new(
        mean: &[f64],
        deviations: &[f64],
        correlations: Option<&[Vec<f64>]>,
    ) -> Result<Correlated, InvalidParameter> {
        let n = mean.len();
        if deviations.len() != n {
            let reason = format!("has {} numbers for {n} means", deviations.len());
            return Err(invalid("deviations", reason));
        }
        if let Some(wrong) = deviations.iter().find(|one| !(one.is_finite() && **one >= 0.0)) {
            return Err(invalid("deviations", format!("{wrong} is negative or not finite")));
        }
        let refuse = |reason: String| invalid("correlations", reason);
        if let Some(rows) = correlations {
            if rows.len() != n || rows.iter().any(|row| row.len() != n) {
                return Err(refuse(format!("is not a matrix of {n} rows with {n} numbers")));
            }
            for (i, row) in rows.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    if i == j && *value != 1.0 {
                        return Err(refuse(format!("has {value} on its diagonal, where 1 belongs")));
                    }
                    if *value != rows[j][i] {
                        return Err(refuse(format!("is not symmetric: {value} against {}", rows[j][i])));
                    }
                }
            }
        }
        let one = |i: usize, j: usize| correlations.map_or(f64::from(u8::from(i == j)), |rows| rows[i][j]);
        let mut cholesky = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..=i {
                let sum: f64 = (0..j).map(|k| cholesky[i][k] * cholesky[j][k]).sum();
                let rest = one(i, j) - sum;
                if i == j {
                    // A number determined by the others has zero remaining variance; rounding may make it slightly negative.
                    if rest.is_nan() || rest < -1e-12 {
                        return Err(refuse(
                            "contradicts itself: no random numbers have these correlations".into(),
                        ));
                    }
                    cholesky[i][i] = libm::sqrt(rest.max(0.0));
                } else if cholesky[j][j] > 1e-7 {
                    cholesky[i][j] = rest / cholesky[j][j];
                } else if rest.abs() > 1e-6 {
                    return Err(refuse(
                        "contradicts itself: no random numbers have these correlations".into(),
                    ));
                }
            }
        }
        for (row, deviation) in cholesky.iter_mut().zip(deviations) {
            row.iter_mut().for_each(|value| *value *= deviation);
        }
        Ok(Correlated {
            mean: mean.to_vec(),
            cholesky,
        })
    }

    /// Its dimension, which is also how many numbers in (0, 1) a sample takes.
    pub fn len(&self) -> usize {
        self.mean.len()
    }

    /// Whether the dimension is zero.
    pub fn is_empty(&self) -> bool {
        self.mean.is_empty()
    }

    /// The sample for numbers in (0, 1).
    pub fn quantile(&self, u: &[f64]) -> Vec<f64> {
        let z: Vec<f64> = u.iter().map(|u| quantile(*u)).collect();
        let rows = self.mean.iter().zip(&self.cholesky);
        rows.map(|(mean, row)| mean + row.iter().zip(&z).map(|(a, b)| a * b).sum::<f64>())
            .collect()
    }
}

/// A unit vector with uniformly distributed direction.
pub fn on_sphere(u: [f64; 2]) -> [f64; 3] {
    let z = 1.0 - 2.0 * u[0];
    let radius = libm::sqrt((1.0 - z) * (1.0 + z));
    [radius * libm::cos(TAU * u[1]), radius * libm::sin(TAU * u[1]), z]
}

/// A unit vector uniformly distributed in the cone within `half_angle` (rad, at most π) of the direction `axis`, which need not have
/// length one.
pub fn in_cone(axis: [f64; 3], half_angle: f64, u: [f64; 2]) -> [f64; 3] {
    let half = libm::sin(0.5 * half_angle);
    // One minus the cosine of the angle to the axis, accurate also for a narrow cone.
    let short = u[0] * 2.0 * half * half;
    let across = libm::sqrt(short * (2.0 - short));
    let length = libm::sqrt(axis.iter().map(|x| x * x).sum());
    let axis = axis.map(|x| x / length);
    let (first, second) = perpendicular_pair(axis);
    let (c, s) = (libm::cos(TAU * u[1]), libm::sin(TAU * u[1]));
    std::array::from_fn(|i| (1.0 - short) * axis[i] + across * (c * first[i] + s * second[i]))
}

/// Two unit vectors perpendicular to the unit vector `axis` and to each other.
fn perpendicular_pair(axis: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    // Start from the coordinate axis least aligned with `axis`.
    let mut helper = [0.0; 3];
    let least = (0..3).min_by(|a, b| f64::total_cmp(&axis[*a].abs(), &axis[*b].abs()));
    helper[least.unwrap_or(0)] = 1.0;
    let first = cross(axis, helper);
    let length = libm::sqrt(first.iter().map(|x| x * x).sum());
    let first = first.map(|x| x / length);
    (first, cross(axis, first))
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
