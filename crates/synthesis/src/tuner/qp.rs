//! The smallest element of a convex hull, and the quadratic program of a bundle step.

/// Minimises `½ |Σ λᵢ gᵢ|²_W − Σ λᵢ fᵢ` over the unit simplex, given the Gram matrix `q[i][j] = gᵢᵀ W gⱼ` and `f`.
///
/// A primal-dual interior-point method with Mehrotra's predictor and corrector: the sets are small (up to a few hundred),
/// often nearly linearly dependent, and an active-set method would cycle on them.
pub(crate) fn simplex_qp(q: &[Vec<f64>], f: &[f64]) -> Vec<f64> {
    let n = f.len();
    if n == 1 {
        return vec![1.0];
    }
    // Work in units of the largest entry, so that the tolerances below are meaningful.
    let scale = q
        .iter()
        .flatten()
        .chain(f)
        .fold(0.0f64, |m, x| m.max(x.abs()))
        .max(f64::MIN_POSITIVE);
    let q: Vec<Vec<f64>> = q.iter().map(|r| r.iter().map(|x| x / scale).collect()).collect();
    let f: Vec<f64> = f.iter().map(|x| x / scale).collect();
    let mut lambda = vec![1.0 / n as f64; n];
    let mut slack = vec![1.0; n];
    let mut level = 0.0; // multiplier of Σ λ = 1
    for _ in 0..60 {
        let product: Vec<f64> = q.iter().map(|r| dot(r, &lambda)).collect();
        let dual: Vec<f64> = (0..n).map(|i| product[i] - f[i] - level - slack[i]).collect();
        let primal = lambda.iter().sum::<f64>() - 1.0;
        let mu = dot(&lambda, &slack) / n as f64;
        let worst = dual.iter().fold(primal.abs(), |m, x| m.max(x.abs()));
        if mu < 1e-14 && worst < 1e-12 {
            break;
        }
        // (Q + S/Λ) dλ − 1 dτ = −dual + (σμ − correction − λs)/λ ; 1ᵀ dλ = −primal
        let mut m = q.clone();
        for i in 0..n {
            m[i][i] += slack[i] / lambda[i] + 1e-15;
        }
        let Some(factor) = cholesky(m) else { break };
        let ones = solve(&factor, &vec![1.0; n]);
        let total: f64 = ones.iter().sum();
        let step = |target: &[f64]| {
            let rhs: Vec<f64> = (0..n)
                .map(|i| -dual[i] + (target[i] - lambda[i] * slack[i]) / lambda[i])
                .collect();
            let base = solve(&factor, &rhs);
            let d_level = (-primal - base.iter().sum::<f64>()) / total;
            let d_lambda: Vec<f64> = (0..n).map(|i| base[i] + d_level * ones[i]).collect();
            let d_slack: Vec<f64> = (0..n)
                .map(|i| (target[i] - lambda[i] * slack[i] - slack[i] * d_lambda[i]) / lambda[i])
                .collect();
            (d_lambda, d_slack, d_level)
        };
        let longest = |x: &[f64], d: &[f64]| {
            x.iter()
                .zip(d)
                .filter(|(_, d)| **d < 0.0)
                .fold(1.0f64, |t, (x, d)| t.min(-x / d))
        };
        let (al, as_, _) = step(&vec![0.0; n]);
        let (tp, td) = (longest(&lambda, &al), longest(&slack, &as_));
        let mu_affine: f64 = (0..n)
            .map(|i| (lambda[i] + tp * al[i]) * (slack[i] + td * as_[i]))
            .sum::<f64>()
            / n as f64;
        let sigma = (mu_affine / mu).powi(3);
        let target: Vec<f64> = (0..n).map(|i| sigma * mu - al[i] * as_[i]).collect();
        let (dl, ds, dt) = step(&target);
        let t = 0.995 * longest(&lambda, &dl).min(longest(&slack, &ds));
        for i in 0..n {
            lambda[i] += t * dl[i];
            slack[i] += t * ds[i];
        }
        level += t * dt;
    }
    let sum: f64 = lambda.iter().sum();
    lambda.iter().map(|x| x / sum).collect()
}

/// The smallest element of the convex hull of `points`: its weights and itself.
pub(crate) fn least_in_hull(points: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let gram: Vec<Vec<f64>> = points
        .iter()
        .map(|a| points.iter().map(|b| dot(a, b)).collect())
        .collect();
    let lambda = simplex_qp(&gram, &vec![0.0; points.len()]);
    let least = combine(points, &lambda);
    (lambda, least)
}

/// `Σ λᵢ pᵢ`.
pub(crate) fn combine(points: &[Vec<f64>], lambda: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; points[0].len()];
    for (p, l) in points.iter().zip(lambda) {
        for (s, x) in sum.iter_mut().zip(p) {
            *s += l * x;
        }
    }
    sum
}

/// Inner product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Euclidean length.
pub(crate) fn length(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn cholesky(mut m: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for j in 0..m.len() {
        for k in 0..j {
            let factor = m[j][k];
            for row in m.iter_mut().skip(j) {
                row[j] -= row[k] * factor;
            }
        }
        if m[j][j].is_nan() || m[j][j] <= 0.0 {
            return None;
        }
        let root = m[j][j].sqrt();
        for row in m.iter_mut().skip(j) {
            row[j] /= root;
        }
    }
    Some(m)
}

fn solve(l: &[Vec<f64>], b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut x = b.to_vec();
    for i in 0..n {
        x[i] = (x[i] - dot(&l[i][..i], &x[..i])) / l[i][i];
    }
    for i in (0..n).rev() {
        let tail: f64 = (i + 1..n).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - tail) / l[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_element_of_a_hull() {
        let (lambda, least) = least_in_hull(&[vec![1.0, 1.0], vec![1.0, -1.0], vec![3.0, 0.0]]);
        assert!((least[0] - 1.0).abs() < 1e-9 && least[1].abs() < 1e-9, "{least:?}");
        assert!((lambda[0] - 0.5).abs() < 1e-8 && lambda[2] < 1e-8);
        // The origin inside: the least element is zero.
        let (_, least) = least_in_hull(&[vec![1.0, 0.0], vec![-1.0, 1.0], vec![-1.0, -2.0], vec![1.0, 1.0]]);
        assert!(length(&least) < 1e-7);
    }

    #[test]
    fn higher_piece_receives_the_weight() {
        let lambda = simplex_qp(&[vec![1.0, 0.0], vec![0.0, 1.0]], &[10.0, 0.0]);
        assert!(lambda[0] > 1.0 - 1e-9);
    }
}
