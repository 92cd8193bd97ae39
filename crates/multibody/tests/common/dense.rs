//! Small dense algebra over rows, for the checks.

/// Cholesky factor, or the index of the pivot that is not positive.
pub(crate) fn cholesky(m: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, usize> {
    let n = m.len();
    let mut l = vec![vec![0.0; n]; n];
    for j in 0..n {
        let d = m[j][j] - l[j][..j].iter().map(|x| x * x).sum::<f64>();
        if d.is_nan() || d <= 0.0 {
            return Err(j);
        }
        l[j][j] = d.sqrt();
        for i in j + 1..n {
            let s: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            l[i][j] = (m[i][j] - s) / l[j][j];
        }
    }
    Ok(l)
}

/// M⁻¹ f.
pub(crate) fn solve(m: &[Vec<f64>], f: &[f64]) -> Vec<f64> {
    let l = cholesky(m).expect("a positive definite mass matrix");
    let n = f.len();
    let mut x = f.to_vec();
    for i in 0..n {
        let s: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - s) / l[i][i];
    }
    for i in (0..n).rev() {
        let s: f64 = (i + 1..n).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - s) / l[i][i];
    }
    x
}

pub(crate) fn times(m: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    m.iter().map(|row| dot(row, x)).collect()
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(crate) fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// √(fᵀ M⁻¹ f).
pub(crate) fn force_size(m: &[Vec<f64>], f: &[f64]) -> f64 {
    dot(f, &solve(m, f)).max(0.0).sqrt()
}

/// √(aᵀ M a).
pub(crate) fn motion_size(m: &[Vec<f64>], a: &[f64]) -> f64 {
    dot(a, &times(m, a)).max(0.0).sqrt()
}

/// Largest |ΔM_ij| / √(M_ii M_jj).
pub(crate) fn matrix_error(m: &[Vec<f64>], a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..m.len() {
        for j in 0..m.len() {
            let e = (a[i][j] - b[i][j]).abs() / (m[i][i] * m[j][j]).sqrt();
            worst = if e.is_nan() { f64::NAN } else { worst.max(e) };
        }
    }
    worst
}
