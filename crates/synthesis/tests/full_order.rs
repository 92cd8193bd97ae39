//! The full-order optimum against problems with known solutions.

use synthesis::full_order::{FullOrderError, full_order_optimum};
use synthesis::interconnect::lft_lower;
use synthesis::linalg::{Matrix, eigenvalues, from_rows};
use synthesis::norm::hinf_norm;
use synthesis::state_space::StateSpace;

/// Doyle, Glover, Khargonekar and Francis' scalar problem in one state: ẋ = a x + w₁ + u, z = (x, u), y = x + w₂. Both
/// Riccati equations are scalar: X = γ²(a + √(a² + 1 − γ⁻²))/(γ² − 1) = Y, and the optimum is where X Y = γ².
#[test]
fn scalar_problem_in_closed_form() {
    for a in [-2.0, 0.0, 0.5, 3.0] {
        let plant = StateSpace::new(
            from_rows(&[vec![a]]).unwrap(),
            from_rows(&[vec![1.0, 0.0, 1.0]]).unwrap(),
            from_rows(&[vec![1.0], vec![0.0], vec![1.0]]).unwrap(),
            from_rows(&[vec![0.0, 0.0, 0.0], vec![0.0, 0.0, 1.0], vec![0.0, 1.0, 0.0]]).unwrap(),
        )
        .unwrap();
        let x = |g: f64| (a + (a * a + 1.0 - 1.0 / (g * g)).sqrt()) / (1.0 - 1.0 / (g * g));
        // The optimum: the last γ at which X ≥ 0 exists and X² < γ².
        let (mut low, mut high) = (1e-3, 100.0);
        let feasible = |g: f64| {
            let root = a * a + 1.0 - 1.0 / (g * g);
            // Below one the quadratic term changes sign; then both roots matter and X = (a + √…)/(1 − γ⁻²) is negative
            // unless a + √… is.
            root > 0.0 && x(g) >= 0.0 && x(g) * x(g) < g * g
        };
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if feasible(middle) { high = middle } else { low = middle }
        }
        let (below, above) = full_order_optimum(&plant, 1, 1, 1e-6).unwrap();
        assert!(
            below <= high * (1.0 + 1e-5) && above >= high * (1.0 - 1e-5),
            "a = {a}: {below}..{above}, closed form {high}"
        );
    }
}

/// A generalised plant with inputs [w; u] and outputs [z; y].
fn plant(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]], d: &[&[f64]]) -> StateSpace {
    let m = |rows: &[&[f64]]| from_rows(&rows.iter().map(|r| r.to_vec()).collect::<Vec<_>>()).unwrap();
    StateSpace::new(m(a), m(b), m(c), m(d)).unwrap()
}

/// The closed-loop norm of `u = k y`; `None` when it is not stable.
fn norm_of(p: &StateSpace, k: f64) -> Option<f64> {
    let closed = lft_lower(p, &StateSpace::gain(from_rows(&[vec![k]]).unwrap())).ok()?;
    hinf_norm(&closed, 1e-8).ok().map(|n| n.gain)
}

#[test]
fn unstabilisable_plant_is_refused() {
    let p = plant(
        &[&[1.0]],
        &[&[1.0, 0.0, 0.0]],
        &[&[1.0], &[0.0], &[1.0]],
        &[&[0.0, 0.0, 0.0], &[0.0, 0.0, 1.0], &[0.0, 1.0, 0.0]],
    );
    assert!(matches!(
        full_order_optimum(&p, 1, 1, 1e-3),
        Err(FullOrderError::Infeasible(_))
    ));
}

/// Where P12 and P21 have stable inverses everything can be cancelled: the optimum is zero, and both Riccati solutions are.
/// In the last of these the transposed data have the same answer.
#[test]
fn invertible_plants_have_optimum_zero() {
    let feedthrough: &[&[f64]] = &[&[0.0, 1.0], &[1.0, 0.0]];
    let problems = [
        plant(
            &[&[-2.0, 2.0], &[-2.0, -2.0]],
            &[&[-1.0, 1.0], &[0.0, 1.0]],
            &[&[-1.0, 0.0], &[0.0, 1.0]],
            feedthrough,
        ),
        plant(
            &[&[-1.0, 1.0], &[-1.0, -2.0]],
            &[&[-1.0, -1.0], &[0.0, 0.0]],
            &[&[0.0, 1.0], &[-1.0, -1.0]],
            feedthrough,
        ),
    ];
    let two_by_two = plant(
        &[&[-0.87]],
        &[&[-0.377, 0.133, 0.29, -1.07]],
        &[&[0.577], &[0.81], &[0.89], &[1.879]],
        &[
            &[0.0, 0.0, 0.987, -0.156],
            &[0.0, 0.0, -1.42, -0.0623],
            &[-0.662, 1.104, 0.0, 0.0],
            &[-0.0885, -1.249, 0.0, 0.0],
        ],
    );
    for (p, size) in problems.iter().map(|p| (p, 1)).chain([(&two_by_two, 2)]) {
        for p in [p.clone(), p.dual()] {
            let (low, high) = full_order_optimum(&p, size, size, 1e-6).unwrap();
            assert!(low == 0.0 && high < 1e-6, "{low}..{high}");
        }
    }
    // The static gain −0.2 is no optimum.
    assert!((norm_of(&problems[0], -0.2).unwrap() - 0.24332).abs() < 1e-5);
}

/// B1 = B2 and D12 = 1: u = −y is optimal, with gamma = 1, because P12 has zeros in the right half-plane.
#[test]
fn inner_plant_has_optimum_one() {
    let p = plant(
        &[&[0.0, -2.0], &[2.0, -1.0]],
        &[&[-1.0, -1.0], &[-1.0, -1.0]],
        &[&[1.0, 1.0], &[0.0, -1.0]],
        &[&[0.0, 1.0], &[1.0, 0.0]],
    );
    assert!((norm_of(&p, -1.0).unwrap() - 1.0).abs() < 1e-7);
    let (low, high) = full_order_optimum(&p, 1, 1, 1e-6).unwrap();
    assert!(
        low <= 1.0 + 1e-7 && high >= 1.0 - 1e-7 && high - low < 1e-5,
        "{low}..{high}"
    );
}

/// One zero of P12 in the right half-plane and none of P21: the closed loop there is P11, whatever the controller, and a
/// constant modulus is best (Zames 1981): the optimum is |P11(zero)|. On random plants; and no static gain beats the bracket.
#[test]
fn single_right_zero_gives_the_plant_there() {
    let mut state = 7u64;
    let mut next_random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 33) as f64 / (1u64 << 31) as f64) * 2.0 - 1.0
    };
    let mut seen = [0; 2];
    for _ in 0..4000 {
        let n = 1 + seen[0] % 4;
        let mut matrix = |rows, columns| Matrix::from_fn(rows, columns, |_, _| next_random());
        let a = matrix(n, n) - Matrix::identity(n, n) * 0.8f64;
        let (b, c) = (matrix(n, 2), matrix(2, n));
        let d = from_rows(&[vec![0.0, 1.0], vec![1.0, 0.0]]).unwrap();
        let p = StateSpace::new(a, b, c, d).unwrap();
        let column = |j: usize| Matrix::from_fn(n, 1, |i, _| p.b[(i, j)]);
        let row = |i: usize| Matrix::from_fn(1, n, |_, j| p.c[(i, j)]);
        let control = eigenvalues(&(&p.a - column(1) * row(0))).unwrap();
        let filter = eigenvalues(&(&p.a - column(0) * row(1))).unwrap();
        let right: Vec<_> = control.iter().filter(|z| z.re > 0.0).collect();
        let clear = control.iter().chain(&filter).all(|z| z.re.abs() > 0.05);
        if p.spectral_abscissa().unwrap() > -0.05 || !clear || right.len() > 1 || filter.iter().any(|z| z.re > 0.0) {
            continue;
        }
        seen[right.len()] += 1;
        let (low, high) = full_order_optimum(&p, 1, 1, 1e-6).unwrap();
        if let Some(zero) = right.first() {
            let exact = p.evaluate(**zero)[(0, 0)].norm();
            assert!(
                low <= exact * (1.0 + 1e-6) && high >= exact * (1.0 - 1e-6),
                "{low}..{high}, closed form {exact}"
            );
        } else {
            assert!(low == 0.0 && high < 1e-5, "{low}..{high}");
        }
        for k in [-2.0, -1.0, -0.5, -0.2, 0.0, 0.3, 1.0] {
            assert!(norm_of(&p, k).is_none_or(|norm| norm >= low * (1.0 - 1e-7)));
        }
    }
    assert!(seen.iter().all(|n| *n >= 20), "{seen:?}");
}

/// No effort weight: ẋ = x + w₁ + u, z = x, y = x + w₂. From w₂ to z the loop is −1 at the unstable pole, whatever the
/// controller, and high gain comes as near to one as it likes.
#[test]
fn free_effort_is_bracketed() {
    let p = plant(
        &[&[1.0]],
        &[&[1.0, 0.0, 1.0]],
        &[&[1.0], &[1.0]],
        &[&[0.0, 0.0, 0.0], &[0.0, 1.0, 0.0]],
    );
    let (low, high) = full_order_optimum(&p, 1, 1, 1e-4).unwrap();
    assert!(low <= 1.0 + 1e-6 && high >= 1.0 - 1e-6, "{low}..{high}");
    assert!(low > 0.99 && high < 1.02, "{low}..{high}");
}

/// An integrator that no disturbance moves is a zero of P21 on the imaginary axis. ẋ = u, z = (x, u), y = x + w: at zero
/// frequency the state follows minus the noise, so nothing below one is reached, and slow gains reach one.
#[test]
fn zero_on_the_axis_is_bracketed() {
    let p = plant(
        &[&[0.0]],
        &[&[0.0, 1.0]],
        &[&[1.0], &[0.0], &[1.0]],
        &[&[0.0, 0.0], &[0.0, 1.0], &[1.0, 0.0]],
    );
    let (low, high) = full_order_optimum(&p, 1, 1, 1e-4).unwrap();
    assert!(low <= 1.0 + 1e-6 && high >= 1.0 - 1e-6, "{low}..{high}");
    assert!(low > 0.99 && high < 1.02, "{low}..{high}");
}

/// No measurement noise and no effort weight at once; the plant is stable and has norm 1/3 by itself, so zero control bounds it.
#[test]
fn noiseless_measurement_is_no_error() {
    let p = plant(
        &[&[-3.0]],
        &[&[1.0, 1.0]],
        &[&[1.0], &[1.0]],
        &[&[0.0, 0.0], &[0.0, 0.0]],
    );
    let (low, high) = full_order_optimum(&p, 1, 1, 1e-4).unwrap();
    assert!(low <= 1e-3 && high <= 1.0 / 3.0, "{low}..{high}");
}
