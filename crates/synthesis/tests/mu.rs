//! The structured singular value against analytic answers and published figures.

use std::f64::consts::SQRT_2;

use synthesis::interconnect::{feedback, series};
use synthesis::linalg::{
    CMatrix, Matrix, c64, eigenvalues_complex, from_rows, hermitian_eigen, singular_values, to_complex,
};
use synthesis::mu::{Block, Margin, MarginOptions, MuError, Structure, lower_bound, margin, upper_bound};
use synthesis::state_space::StateSpace;

fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "found {found:.10}, expected {expected:.10}"
    );
}

fn structure(blocks: &[Block]) -> Structure {
    Structure::new(blocks.to_vec()).unwrap()
}

fn complex(entries: &[&[(f64, f64)]]) -> CMatrix {
    CMatrix::from_fn(entries.len(), entries[0].len(), |i, j| {
        c64::new(entries[i][j].0, entries[i][j].1)
    })
}

/// Both bounds, with the checks that hold for every matrix: order, structure, and singularity of the perturbation.
fn bounds(m: &CMatrix, blocks: &[Block]) -> (f64, f64) {
    let s = structure(blocks);
    let upper = upper_bound(m, &s, 1e-7).unwrap().value;
    let lower = match lower_bound(m, &s, 30, 1).unwrap() {
        Some(found) => {
            assert!(s.contains(&found.delta, 1e-12));
            let closed = m * &found.delta;
            let rest = CMatrix::from_fn(closed.nrows(), closed.ncols(), |i, j| {
                c64::new(f64::from(u8::from(i == j)), 0.0) - closed[(i, j)]
            });
            let sv = singular_values(&rest).unwrap();
            assert!(sv[sv.len() - 1] < 1e-8 * sv[0].max(1.0), "I − MΔ is not singular");
            1.0 / found.size
        }
        None => 0.0,
    };
    assert!(lower <= upper * (1.0 + 1e-7), "lower {lower} above upper {upper}");
    (lower, upper)
}

/// One full block: the largest singular value. One repeated complex scalar: the spectral radius. One repeated real
/// scalar: the largest real eigenvalue in absolute value.
#[test]
fn single_blocks_have_closed_forms() {
    let m = to_complex(&from_rows(&[vec![1.0, 2.0, 0.0], vec![-3.0, 1.0, 1.0], vec![0.5, 0.0, -2.2]]).unwrap());
    let (lower, upper) = bounds(&m, &[Block::Full { rows: 3, columns: 3 }]);
    let sigma = singular_values(&m).unwrap()[0];
    assert_close(upper, sigma, 1e-6);
    assert_close(lower, sigma, 1e-6);
    let eigenvalues = eigenvalues_complex(&m).unwrap();
    let radius = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let (lower, upper) = bounds(&m, &[Block::Complex(3)]);
    assert_close(upper, radius, 1e-4);
    assert_close(lower, radius, 1e-6);
    let real = eigenvalues
        .iter()
        .filter(|l| l.im.abs() < 1e-12)
        .map(|l| l.re.abs())
        .fold(0.0, f64::max);
    let (lower, upper) = bounds(&m, &[Block::Real(3)]);
    assert_close(upper, real, 1e-3);
    assert_close(lower, real, 1e-9);
    assert!(real < radius);
}

/// A dyad with scalar blocks: μ = Σ |uᵢ vᵢ| (complex), and the spectral radius is far below. A triangular matrix: the
/// largest diagonal entry, however large the corner.
#[test]
fn rank_one_and_triangular_matrices() {
    let (u, v) = (
        [(1.0, 0.5), (-2.0, 0.0), (0.3, 0.3)],
        [(0.2, 0.0), (0.0, 1.0), (-4.0, 1.0)],
    );
    let at = |x: (f64, f64)| c64::new(x.0, x.1);
    let m = CMatrix::from_fn(3, 3, |i, j| at(u[i]) * at(v[j]));
    let expected: f64 = (0..3).map(|i| (at(u[i]) * at(v[i])).norm()).sum();
    let (lower, upper) = bounds(&m, &[Block::Complex(1); 3]);
    assert_close(lower, expected, 1e-6);
    assert_close(upper, expected, 1e-5);
    let triangular =
        to_complex(&from_rows(&[vec![0.5, 10.0, 100.0], vec![0.0, -0.7, 10.0], vec![0.0, 0.0, 0.6]]).unwrap());
    let (lower, upper) = bounds(&triangular, &[Block::Complex(1); 3]);
    assert_close(lower, 0.7, 1e-5);
    assert!((0.7..0.75).contains(&upper), "{upper}");
}

/// Morton and Doyle's example, as printed by Packard and Doyle 1993 (section 9.2): four complex scalars, D-bound 1,
/// μ about 0.87. It shows that the D-bound is not exact for four blocks.
#[test]
fn morton_and_doyle_gap_of_four_blocks() {
    let gamma = 3.0 + 3f64.sqrt();
    let beta = 3f64.sqrt() - 1.0;
    let (a, b) = ((2.0 / gamma).sqrt(), 1.0 / gamma.sqrt());
    let c = 1.0 / gamma.sqrt();
    let d = -(beta / gamma).sqrt();
    let f = c64::new(1.0, 1.0) * (1.0 / (gamma * beta)).sqrt();
    let (psi1, psi2) = (-std::f64::consts::FRAC_PI_2, std::f64::consts::PI);
    let e = |x: f64| c64::new(0.0, x).exp();
    let r = |x: f64| c64::new(x, 0.0);
    let u = [[r(a), r(0.0)], [r(b), r(b)], [r(c), c64::new(0.0, c)], [r(d), f]];
    let v = [
        [r(0.0), r(a)],
        [r(b), r(-b)],
        [r(c), c64::new(0.0, -c)],
        [f * e(psi1), r(d) * e(psi2)],
    ];
    let m = CMatrix::from_fn(4, 4, |i, j| u[i][0] * v[j][0].conj() + u[i][1] * v[j][1].conj());
    let (lower, upper) = bounds(&m, &[Block::Complex(1); 4]);
    assert_close(upper, 1.0, 1e-5);
    assert_close(lower, 0.8723, 1e-3);
}

/// The worked example of SLICOT's AB13MD: two real scalars, a full 2 × 2 block, two complex scalars; printed 41.74753408.
#[test]
fn mixed_blocks_of_the_slicot_example() {
    let top = [(-1.0, 6.0), (2.0, -3.0), (3.0, 8.0)];
    let rows: [&[(f64, f64)]; 6] = [
        &[top[0], top[1], top[2], (3.0, 8.0), (-5.0, -9.0), (-6.0, 2.0)],
        &[
            (4.0, 2.0),
            (-2.0, 5.0),
            (-6.0, -7.0),
            (-4.0, 11.0),
            (8.0, -7.0),
            (12.0, -1.0),
        ],
        &[
            (5.0, -4.0),
            (-4.0, -8.0),
            (1.0, -3.0),
            (-6.0, 14.0),
            (2.0, -5.0),
            (4.0, 16.0),
        ],
        &[top[0], top[1], top[2], (3.0, 8.0), (-5.0, -9.0), (-6.0, 2.0)],
        &[
            (4.0, 2.0),
            (-2.0, 5.0),
            (-6.0, -7.0),
            (-4.0, 11.0),
            (8.0, -7.0),
            (12.0, -1.0),
        ],
        &[
            (5.0, -4.0),
            (-4.0, -8.0),
            (1.0, -3.0),
            (-6.0, 14.0),
            (2.0, -5.0),
            (4.0, 16.0),
        ],
    ];
    let blocks = [
        Block::Real(1),
        Block::Real(1),
        Block::Full { rows: 2, columns: 2 },
        Block::Complex(1),
        Block::Complex(1),
    ];
    let (lower, upper) = bounds(&complex(&rows), &blocks);
    assert_close(upper, 41.74753408, 1e-5);
    assert!(lower > 0.5 * upper, "{lower}");
}

/// One complex and one real scalar, where the upper bound is exact (Meinsma, Shrivastava and Fu 1997); the figures agree with
/// SLICOT's AB13MD. The least is at moderate scalings, between large ones that prove less.
#[test]
fn one_complex_and_one_real_scalar_are_exact() {
    /// Real and imaginary parts.
    type Complex2x2 = [[(f64, f64); 2]; 2];
    let cases: [(Complex2x2, f64); 4] = [
        ([[(-0.6, -1.1), (1.0, -0.5)], [(0.2, -0.4), (-0.6, -0.6)]], 1.479385),
        ([[(0.4, 1.8), (-0.3, -0.7)], [(0.2, 0.0), (0.3, 0.4)]], 1.907473),
        ([[(1.8, -0.3), (-0.9, -0.9)], [(-0.6, 0.0), (-0.7, -0.7)]], 2.038840),
        ([[(0.6, 2.3), (1.4, 1.4)], [(-0.1, 0.4), (-0.5, -0.9)]], 2.526744),
    ];
    for (rows, known) in cases {
        let m = complex(&[&rows[0], &rows[1]]);
        let (lower, upper) = bounds(&m, &[Block::Full { rows: 1, columns: 1 }, Block::Real(1)]);
        assert_close(upper, known, 1e-6);
        assert_close(lower, known, 1e-6);
        assert_close(least_bound(&m), known, 1e-6);
    }
}

/// The least bound of a matrix with one full block and, last, one real scalar, by nested golden sections over the ratio of the
/// two D and over G.
fn least_bound(m: &CMatrix) -> f64 {
    let n = m.nrows();
    let real = n - 1;
    let proved = |d: f64, g: f64| -> f64 {
        // D = diag(d² I, 1), G = diag(0, g), in the congruence that makes D the identity.
        let size = |i: usize| if i < real { d } else { 1.0 };
        let scaled = CMatrix::from_fn(n, n, |i, j| m[(i, j)] * (size(i) / size(j)));
        let f = CMatrix::from_fn(n, n, |i, j| {
            let product: c64 = (0..n).map(|k| scaled[(k, i)].conj() * scaled[(k, j)]).sum();
            let turned = |column: usize| c64::new(0.0, g) * scaled[(real, column)];
            let left = if i == real { turned(j) } else { c64::new(0.0, 0.0) };
            let right = if j == real {
                turned(i).conj()
            } else {
                c64::new(0.0, 0.0)
            };
            product + left + right
        });
        hermitian_eigen(&f).unwrap().0[n - 1]
    };
    let golden = |low: f64, high: f64, f: &dyn Fn(f64) -> f64| -> f64 {
        let part = 0.381_966_011_250_105;
        let (mut a, mut b) = (low, high);
        let (mut x, mut y) = (a + part * (b - a), b - part * (b - a));
        let (mut fx, mut fy) = (f(x), f(y));
        for _ in 0..75 {
            if fx < fy {
                (b, y, fy) = (y, x, fx);
                x = a + part * (b - a);
                fx = f(x);
            } else {
                (a, x, fx) = (x, y, fy);
                y = b - part * (b - a);
                fy = f(y);
            }
        }
        fx.min(fy)
    };
    let least = golden(-12.0, 12.0, &|d| golden(-3e3, 3e3, &|g| proved(d.exp(), g)));
    least.max(0.0).sqrt()
}

/// Numbers in [−1, 1], the same on every machine.
fn random_numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 33) as f64 / (1u64 << 31) as f64) * 2.0 - 1.0
    }
}

fn random(next_random: &mut impl FnMut() -> f64, rows: usize, columns: usize) -> CMatrix {
    CMatrix::from_fn(rows, columns, |_, _| c64::new(next_random(), next_random()))
}

/// A brute-force search finds no better scalings, on matrices with entries over two decades, and the returned scalings are a proof.
#[test]
fn upper_bound_is_the_least_over_d_and_g() {
    let mut next_random = random_numbers(3);
    for (full, count) in [(1, 60), (2, 30), (3, 10)] {
        for _ in 0..count {
            let m = CMatrix::from_fn(full + 1, full + 1, |_, _| {
                c64::new(next_random(), next_random()) * 10f64.powf(next_random())
            });
            let known = least_bound(&m);
            let s = structure(&[
                Block::Full {
                    rows: full,
                    columns: full,
                },
                Block::Real(1),
            ]);
            let upper = upper_bound(&m, &s, 1e-7).unwrap();
            let found = upper.value;
            assert!(
                found <= known * (1.0 + 1e-6),
                "found {found:.9}, brute force {known:.9}: {m:?}"
            );
            let (d, g) = (&upper.scalings.d_left, &upper.scalings.g);
            let (dm, gm) = (synthesis::linalg::adjoint(&m) * d * &m, g * &m);
            let certificate = CMatrix::from_fn(full + 1, full + 1, |i, j| {
                let turned = c64::new(0.0, 1.0) * (gm[(i, j)] - gm[(j, i)].conj());
                upper.scalings.d_right[(i, j)] * (found * found) - dm[(i, j)] - turned
            });
            let values = hermitian_eigen(&certificate).unwrap().0;
            // Evaluated in another order, so to rounding of its terms.
            let rounding = 1e-14 * (synthesis::linalg::max_abs(&gm) + values[full]);
            assert!(values[0] > -rounding, "{found} is not proved: {values:?}");
        }
    }
}

/// mu of a 2 × 2 matrix with a real and a complex scalar, from the determinant: for every real parameter the complex one that
/// makes it vanish is known, and the larger of the two is searched along a line.
fn exact_mu(m: &CMatrix) -> f64 {
    let one = c64::new(1.0, 0.0);
    let size = |real: f64| -> f64 {
        let rest = one - m[(0, 0)] * real;
        let factor = m[(1, 1)] * rest + m[(0, 1)] * m[(1, 0)] * real;
        real.abs().max((rest / factor).norm())
    };
    let points: Vec<f64> = (0..40001).map(|i| unbounded(f64::from(i - 20000) / 20001.0)).collect();
    let best = (1..points.len() - 1)
        .min_by(|&i, &j| size(points[i]).total_cmp(&size(points[j])))
        .unwrap();
    let (mut low, mut high) = (points[best - 1], points[best + 1]);
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if size(a) < size(b) { high = b } else { low = a }
    }
    1.0 / size(0.5 * (low + high))
}

/// Maps (−1, 1) to all numbers, densest around zero.
fn unbounded(x: f64) -> f64 {
    x / (1.0 - x * x)
}

/// With one full block and one real scalar there is no gap (Meinsma, Shrivastava and Fu 1997): the bound is mu itself.
#[test]
fn upper_bound_is_mu_for_a_real_and_a_complex_scalar() {
    let mut next_random = random_numbers(29);
    for _ in 0..60 {
        let m = random(&mut next_random, 2, 2);
        let upper = upper_bound(&m, &structure(&[Block::Real(1), Block::Complex(1)]), 1e-7).unwrap();
        assert_close(upper.value, exact_mu(&m), 1e-6);
    }
}

/// The upper bound is exact for up to three complex blocks, and for one repeated scalar beside one full block
/// (Packard and Doyle 1993): the perturbation found must be as large as the bound says.
#[test]
fn upper_bound_is_exact_for_few_blocks() {
    let full = |rows: usize, columns: usize| Block::Full { rows, columns };
    let structures = [
        vec![Block::Complex(1); 3],
        vec![full(2, 1), full(1, 2), Block::Complex(1)],
        vec![Block::Complex(2), full(1, 1)],
    ];
    let mut next_random = random_numbers(11);
    for blocks in structures {
        let s = structure(&blocks);
        let mut apart = 0;
        for _ in 0..20 {
            let m = random(&mut next_random, s.columns(), s.rows());
            let (lower, upper) = bounds(&m, &blocks);
            assert!(lower > 0.9 * upper, "{blocks:?}: {lower} {upper}");
            // The search for a perturbation may end at a lower local maximum, but not in all cases.
            apart += usize::from(lower < upper * (1.0 - 1e-6));
        }
        assert!(apart <= 4, "{blocks:?}: {apart} of 20 apart");
    }
}

fn checked_margin(m: &StateSpace, s: &Structure, options: &MarginOptions) -> Margin {
    let found = margin(m, s, options).unwrap();
    assert!(
        found.guaranteed <= found.destabilising * (1.0 + 1e-9),
        "{} {}",
        found.guaranteed,
        found.destabilising
    );
    if let Some(p) = &found.perturbation {
        assert!(s.contains(&p.delta, 1e-9));
        assert_close(s.norm(&p.delta).unwrap(), p.size, 1e-9);
        // Apply it: one eigenvalue of the closed loop lies on the axis, at the stated frequency.
        let closed = |k: f64| {
            let scaled = CMatrix::from_fn(p.delta.nrows(), p.delta.ncols(), |i, j| p.delta[(i, j)] * k);
            assert!(synthesis::linalg::max_abs(&m.d) == 0.0);
            eigenvalues_complex(&(to_complex(&m.a) + to_complex(&m.b) * scaled * to_complex(&m.c))).unwrap()
        };
        let nearest = closed(1.0)
            .into_iter()
            .map(|l| (l.re.hypot(l.im.abs() - p.omega), l.re))
            .fold((f64::INFINITY, 0.0), |a, b| if b.0 < a.0 { b } else { a });
        assert!(
            nearest.0 < 1e-6 * (1.0 + p.omega),
            "no eigenvalue at {} rad/s: {nearest:?}",
            p.omega
        );
        // Along this direction a perturbation slightly smaller than the guarantee does not destabilise.
        assert!(closed(0.999 * found.guaranteed / p.size).iter().all(|l| l.re < 0.0));
    }
    found
}

/// The spinning body of the textbooks (Skogestad and Postlethwaite, section 3.7.1; Zhou, Doyle and Glover, section 9.6),
/// a = 10, unity feedback, a multiplicative error at each input: T(s) = 1/(s+1) [1 a; −a 1], μ = √(1 + a²) at zero
/// frequency, for complex and for real errors, while each loop on its own has an infinite gain margin.
#[test]
fn spinning_body_tolerates_a_tenth_at_both_inputs() {
    let a = 10.0;
    let m = StateSpace::new(
        from_rows(&[vec![-1.0, 0.0], vec![0.0, -1.0]]).unwrap(),
        from_rows(&[vec![1.0, 0.0], vec![0.0, 1.0]]).unwrap(),
        from_rows(&[vec![-1.0, -a], vec![a, -1.0]]).unwrap(),
        Matrix::zeros(2, 2),
    )
    .unwrap();
    let exact = 1.0 / 101f64.sqrt();
    for blocks in [[Block::Complex(1); 2], [Block::Real(1); 2]] {
        let found = checked_margin(
            &m,
            &structure(&blocks),
            &MarginOptions {
                slack: 1e-4,
                ..MarginOptions::default()
            },
        );
        assert_close(found.guaranteed, exact, 1e-3);
        assert_close(found.destabilising, exact, 1e-6);
        assert!(found.guaranteed <= exact);
    }
    // One input alone: det(I + …) never vanishes for real errors below one.
    let one = m.select(0..1, 0..1);
    let found = margin(&one, &structure(&[Block::Real(1)]), &MarginOptions::default()).unwrap();
    assert!(found.guaranteed >= 0.99, "{}", found.guaranteed);
}

/// The example in MATLAB's documentation of `robstab`: 18/(s² + 1.8 s + k)·(1 + 0.5 δ), k = 10 ± 40 %, under
/// the controller `pid(2.3, 3, 0.38, 0.001)`. Documented: guaranteed 1.5960, destabilising 1.5993, near 4.88 rad/s.
#[test]
fn documented_robust_stability_example() {
    // Generalised plant, inputs (w_k, w_δ, u), outputs (z_k, z_δ, y): the stiffness error 4 δ_k x enters as a force.
    let plant = StateSpace::new(
        from_rows(&[vec![0.0, 1.0], vec![-10.0, -1.8]]).unwrap(),
        from_rows(&[vec![0.0, 0.0, 0.0], vec![-1.0, 18.0, 18.0]]).unwrap(),
        from_rows(&[vec![4.0, 0.0], vec![0.0, 0.0], vec![1.0, 0.0]]).unwrap(),
        from_rows(&[vec![0.0, 0.0, 0.0], vec![0.0, 0.0, 0.5], vec![0.0, 0.0, 0.0]]).unwrap(),
    )
    .unwrap();
    let controller = StateSpace::transfer_function(&[-0.3823, -2.303, -3.0], &[0.001, 1.0, 0.0]).unwrap();
    let m = synthesis::interconnect::lft_lower(&plant, &controller).unwrap();
    let s = structure(&[Block::Real(1), Block::Complex(1)]);
    let found = checked_margin(
        &m,
        &s,
        &MarginOptions {
            slack: 1e-4,
            ..MarginOptions::default()
        },
    );
    assert!(found.guaranteed >= 1.5960, "guaranteed {}", found.guaranteed);
    assert_close(found.destabilising, 1.5993, 2e-4);
    assert_close(found.critical, 4.88, 0.02);
}

#[test]
fn bad_input_is_refused_with_the_reason() {
    let m = to_complex(&Matrix::identity(3, 3));
    assert!(matches!(
        upper_bound(&m, &structure(&[Block::Real(2)]), 1e-6),
        Err(MuError::Misfit { .. })
    ));
    assert_eq!(Structure::new(vec![]).unwrap_err(), MuError::Empty);
    assert_eq!(Structure::new(vec![Block::Complex(0)]).unwrap_err(), MuError::Empty);
    let unstable = feedback(
        &StateSpace::transfer_function(&[SQRT_2], &[1.0, -2.0]).unwrap(),
        &StateSpace::transfer_function(&[1.0], &[1.0]).unwrap(),
    )
    .unwrap();
    let loop_ = series(&unstable, &StateSpace::transfer_function(&[1.0], &[1.0, 1.0]).unwrap()).unwrap();
    assert!(matches!(
        margin(&loop_, &structure(&[Block::Complex(1)]), &MarginOptions::default()),
        Err(MuError::Unstable(a)) if a > 0.0
    ));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(24))]

    /// The lower bound never exceeds the upper one, and neither exceeds the norm; `bounds` checks that the perturbation has the
    /// structure and makes the matrix singular.
    #[test]
    fn bounds_are_ordered_for_any_matrix(entries in proptest::collection::vec(-1.0f64..1.0, 50), kind in 0usize..4) {
        let m = CMatrix::from_fn(5, 5, |i, j| c64::new(entries[10 * i + 2 * j], entries[10 * i + 2 * j + 1]));
        let blocks = match kind {
            0 => vec![Block::Complex(1); 5],
            1 => vec![Block::Real(1), Block::Real(2), Block::Complex(2)],
            2 => vec![Block::Full { rows: 2, columns: 2 }, Block::Complex(1), Block::Real(2)],
            _ => vec![Block::Complex(3), Block::Full { rows: 1, columns: 1 }, Block::Real(1)],
        };
        let (lower, upper) = bounds(&m, &blocks);
        proptest::prop_assert!(lower <= upper * (1.0 + 1e-7));
        proptest::prop_assert!(upper <= singular_values(&m).unwrap()[0] * (1.0 + 1e-9));
    }
}
