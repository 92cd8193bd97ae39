//! Random, physically possible moments of inertia.
//!
//! A body's inertia I and the second moments of its mass, J = ½ tr(I) 1 - I, are equivalent. I is physically possible exactly when J has
//! no negative eigenvalue; for principal moments that is the triangle inequality. So the dispersion is applied to J: with any matrix A,
//! A J Aᵀ is again that of a body, stretched and rotated by A.

use super::normal::quantile;
use super::rotation::{misalignment, rotate, rotation_from_vector};

/// Dispersion of a body: stretched along the axes x, y and z and slightly rotated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// The standard deviation of the logarithm of the second moment along each axis.
    pub log_deviation: f64,
    /// The standard deviation of the rotation about each axis, rad.
    pub rotation_deviation: f64,
}

/// Whether three principal moments are those of a body: none exceeds the sum of the others.
pub fn moments_are_physical(moments: [f64; 3]) -> bool {
    second_moments(moments).iter().all(|one| *one >= 0.0) && moments.iter().all(|one| *one > 0.0)
}

fn second_moments(moments: [f64; 3]) -> [f64; 3] {
    let half = 0.5 * (moments[0] + moments[1] + moments[2]);
    moments.map(|moment| half - moment)
}

impl Inertia {
    /// Stretch of each axis: the factor of the second moment along it.
    fn factors(&self, u: [f64; 3]) -> [f64; 3] {
        u.map(|u| libm::exp(self.log_deviation * quantile(u)))
    }

    /// The principal moments of the body for three numbers in (0, 1); `moments` are those of the nominal body.
    pub fn moments(&self, moments: [f64; 3], u: [f64; 3]) -> [f64; 3] {
        let (second, factors) = (second_moments(moments), self.factors(u));
        let j: [f64; 3] = std::array::from_fn(|i| second[i] * factors[i]);
        [j[1] + j[2], j[0] + j[2], j[0] + j[1]]
    }

    /// The same for a full matrix as xx, yy, zz, xy, xz, yz (the elements themselves, with their signs), also rotated, from six numbers.
    pub fn matrix(&self, own: [f64; 6], u: [f64; 6]) -> [f64; 6] {
        let [xx, yy, zz, xy, xz, yz] = own;
        let half = 0.5 * (xx + yy + zz);
        let j = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]];
        let factors = self.factors([u[0], u[1], u[2]]).map(libm::sqrt);
        let q = rotation_from_vector(misalignment(self.rotation_deviation, [u[3], u[4], u[5]]));
        // The columns of A: each axis stretched, then rotated.
        let columns: [[f64; 3]; 3] = std::array::from_fn(|k| {
            let mut axis = [0.0; 3];
            axis[k] = factors[k];
            rotate(q, axis)
        });
        let one = |r: usize, c: usize| -> f64 {
            let terms = (0..9).map(|n| (n / 3, n % 3));
            terms.map(|(a, b)| columns[a][r] * j[a][b] * columns[b][c]).sum()
        };
        let trace = one(0, 0) + one(1, 1) + one(2, 2);
        [
            trace - one(0, 0),
            trace - one(1, 1),
            trace - one(2, 2),
            -one(0, 1),
            -one(0, 2),
            -one(1, 2),
        ]
    }
}
