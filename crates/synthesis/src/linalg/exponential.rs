//! The exponential of a matrix.

use super::construct::check_finite;
use super::error::LinalgError;
use super::matrix::Matrix;
use super::solve::solve;

/// Matrix exponential by scaling and squaring with the [13/13] Padé approximant (Higham 2005, Algorithm 2.3).
pub fn expm(a: &Matrix) -> Result<Matrix, LinalgError> {
    const B: [f64; 14] = [
        64764752532480000.0,
        32382376266240000.0,
        7771770303897600.0,
        1187353796428800.0,
        129060195264000.0,
        10559470521600.0,
        670442572800.0,
        33522128640.0,
        1323241920.0,
        40840800.0,
        960960.0,
        16380.0,
        182.0,
        1.0,
    ];
    // Largest 1-norm for which the unscaled approximant is accurate to double precision (same source, Table 2.3).
    const THETA_13: f64 = 5.371920351148152;
    check_finite(a)?;
    let n = a.nrows();
    let norm1 = (0..n)
        .map(|j| (0..n).map(|i| a[(i, j)].abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let squarings = if norm1 > THETA_13 {
        libm::log2(norm1 / THETA_13).ceil() as i32
    } else {
        0
    };
    let a = a * 0.5f64.powi(squarings);
    let eye = Matrix::identity(n, n);
    let a2 = &a * &a;
    let a4 = &a2 * &a2;
    let a6 = &a4 * &a2;
    let sum = |c: [f64; 4]| &a6 * c[3] + &a4 * c[2] + &a2 * c[1] + &eye * c[0];
    let u = &a * (&a6 * sum([0.0, B[9], B[11], B[13]]) + sum([B[1], B[3], B[5], B[7]]));
    let v = &a6 * sum([0.0, B[8], B[10], B[12]]) + sum([B[0], B[2], B[4], B[6]]);
    let mut x = solve(&(&v - &u), &(&v + &u))?;
    for _ in 0..squarings {
        x = &x * &x;
    }
    Ok(x)
}
