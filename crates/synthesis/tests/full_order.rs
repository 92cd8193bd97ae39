//! The full-order optimum against problems whose answer is known.

use synthesis::full_order::{FullOrderError, full_order_optimum};
use synthesis::linalg::from_rows;
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

/// A plant that nobody can move, and one without effort weight.
#[test]
fn impossible_problems_are_refused() {
    let plant = |b: f64, d12: f64| {
        StateSpace::new(
            from_rows(&[vec![1.0]]).unwrap(),
            from_rows(&[vec![1.0, 0.0, b]]).unwrap(),
            from_rows(&[vec![1.0], vec![0.0], vec![1.0]]).unwrap(),
            from_rows(&[vec![0.0, 0.0, 0.0], vec![0.0, 0.0, d12], vec![0.0, 1.0, 0.0]]).unwrap(),
        )
        .unwrap()
    };
    assert!(matches!(
        full_order_optimum(&plant(0.0, 1.0), 1, 1, 1e-3),
        Err(FullOrderError::Infeasible(_))
    ));
    assert_eq!(
        full_order_optimum(&plant(1.0, 0.0), 1, 1, 1e-3).unwrap_err(),
        FullOrderError::Rank("D12")
    );
}
