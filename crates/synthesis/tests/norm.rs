//! The H-infinity norm against closed forms and published figures.

use synthesis::delay::{DelayError, pade};
use synthesis::interconnect::{append, feedback, lft_lower, parallel, series};
use synthesis::linalg::{Matrix, c64, diagonal, from_rows};
use synthesis::norm::{NormError, hinf_norm};
use synthesis::state_space::{ModelError, StateSpace};

fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "found {found:.12e}, expected {expected:.12e}"
    );
}

fn tf(num: &[f64], den: &[f64]) -> StateSpace {
    StateSpace::transfer_function(num, den).unwrap()
}

/// A second-order section peaks at 1/(2ζ√(1 − ζ²)), at ω√(1 − 2ζ²).
#[test]
fn resonance_peak_follows_the_formula() {
    for zeta in [1e-6, 1e-3, 0.05, 0.3, 0.7] {
        for omega in [1e-4, 1.0, 3e5] {
            let g = tf(&[omega * omega], &[1.0, 2.0 * zeta * omega, omega * omega]);
            let n = hinf_norm(&g, 1e-9).unwrap();
            assert_close(n.gain, 1.0 / (2.0 * zeta * (1.0 - zeta * zeta).sqrt()), 1e-7);
            assert_close(n.omega, omega * (1.0 - 2.0 * zeta * zeta).sqrt(), 1e-3);
        }
    }
}

/// A loop of large gains that nearly cancel: rounding error of the Hamiltonian's eigenvalues, here of any library, moves crossings close
/// to the peak off the axis by a twentieth of their frequency. Expected value: bisection of the gain with 40 digits (mpmath 1.3).
#[test]
fn flat_peak_of_ill_conditioned_loop_is_found() {
    let u = [-1602556.1005679965, -1025479.5184931747, -320511.2201135993];
    let rows = |rows: &[[f64; 3]]| from_rows(&rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>()).unwrap();
    let g = StateSpace::new(
        rows(&[
            [0.0, 1.0, 0.0],
            [2.0 + u[0], 0.3 + u[1], 1.0 + u[2]],
            [0.5 + 0.5 * u[0], 0.5 * u[1], -1.0 + 0.5 * u[2]],
        ]),
        Matrix::identity(3, 3),
        rows(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], u]),
        Matrix::zeros(4, 3),
    )
    .unwrap();
    for tolerance in [1e-6, 1e-7, 1e-8, 1e-9, 1e-10] {
        assert_close(
            hinf_norm(&g, tolerance).unwrap().gain,
            1.6327788215471136,
            tolerance.max(1e-9),
        );
    }
}

/// Peaks at zero and at infinite frequency, and one hidden below a larger static gain elsewhere.
#[test]
fn peaks_at_the_ends_of_the_axis() {
    let n = hinf_norm(&tf(&[3.0], &[1.0, 1.0]), 1e-8).unwrap();
    assert_eq!((n.gain, n.omega), (3.0, 0.0));
    let n = hinf_norm(&tf(&[5.0, 1.0], &[1.0, 1.0]), 1e-8).unwrap();
    assert_close(n.gain, 5.0, 1e-9);
    assert!(n.omega.is_infinite());
    let both = append(&[tf(&[2.0, 0.0], &[1.0, 1.0]), tf(&[1.0], &[1.0, 0.02, 1.0])]);
    assert_close(
        hinf_norm(&both, 1e-9).unwrap().gain,
        50.0 / (1.0f64 - 1e-4).sqrt(),
        1e-8,
    );
    assert_eq!(
        hinf_norm(&StateSpace::gain(diagonal(&[1.0, -4.0])), 1e-8).unwrap().gain,
        4.0
    );
    assert_eq!(hinf_norm(&tf(&[0.0], &[1.0, 1.0]), 1e-8).unwrap().gain, 0.0);
}

/// Peaks a little above the gain at infinite frequency, at no resonance. There R = γ² I − DᵀD is nearly singular, and the eigenvalues
/// of the Hamiltonian alone miss them.
#[test]
fn peaks_just_above_the_gain_at_infinity_are_found() {
    let data: serde_json::Value = serde_json::from_str(include_str!("data/near_direct.json")).unwrap();
    for system in data["systems"].as_array().unwrap() {
        let matrix = |key: &str| -> Matrix {
            let rows: Vec<Vec<f64>> = serde_json::from_value(system[key].clone()).unwrap();
            from_rows(&rows).unwrap()
        };
        let g = StateSpace::new(matrix("A"), matrix("B"), matrix("C"), matrix("D")).unwrap();
        let gain = system["gain"].as_f64().unwrap();
        for tolerance in [1e-6, 1e-7, 1e-8, 1e-9] {
            let n = hinf_norm(&g, tolerance).unwrap();
            assert_close(n.gain, gain, tolerance);
            assert!(n.omega.is_finite());
        }
        // A static output of nearly the same gain at every frequency: no frequency is well below the level.
        let wide = append(&[g.clone(), StateSpace::gain(diagonal(&[gain * (1.0 - 1e-7)]))]);
        assert_close(hinf_norm(&wide, 1e-8).unwrap().gain, gain, 1e-8);
    }
}

/// The worked example of SLICOT's AB13DD: three oscillators in parallel with damping down to 1e-6; its documentation
/// prints 500000.0001 at 1.41421356.
#[test]
fn three_nearly_undamped_oscillators() {
    let a = from_rows(&[
        vec![0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        vec![-0.5, -2e-4, 0.0, 0.0, 0.0, 0.0],
        vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        vec![0.0, 0.0, -1.0, -2e-5, 0.0, 0.0],
        vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        vec![0.0, 0.0, 0.0, 0.0, -2.0, -2e-6],
    ])
    .unwrap();
    let b = Matrix::from_fn(6, 1, |i, _| if i % 2 == 0 { 1.0 } else { 0.0 });
    let g = StateSpace::new(a, b.clone(), b.transpose(), Matrix::zeros(1, 1)).unwrap();
    let n = hinf_norm(&g, 1e-9).unwrap();
    assert_close(n.gain, 500000.0001, 1e-9);
    assert_close(n.omega, std::f64::consts::SQRT_2, 1e-8);
}

/// States scaled by twelve orders of magnitude relative to each other: without balancing, rounding errors hide the crossings.
#[test]
fn badly_scaled_states_change_nothing() {
    let chain = series(&tf(&[1.0], &[1.0, 0.02, 1.0]), &tf(&[1.0, 4.0], &[1.0, 0.3, 9.0])).unwrap();
    let reference = hinf_norm(&chain, 1e-9).unwrap();
    let t = [1.0, 1e12, 1e-9, 1e6];
    let scaled = StateSpace {
        a: Matrix::from_fn(4, 4, |i, j| chain.a[(i, j)] * t[j] / t[i]),
        b: Matrix::from_fn(4, 1, |i, _| chain.b[(i, 0)] / t[i]),
        c: Matrix::from_fn(1, 4, |_, j| chain.c[(0, j)] * t[j]),
        d: chain.d.clone(),
    };
    assert_close(hinf_norm(&scaled, 1e-9).unwrap().gain, reference.gain, 1e-8);
}

/// An all-pass is one at every frequency, whatever its order; its phase is the delay's.
#[test]
fn pade_is_all_pass_with_the_phase_of_the_delay() {
    for (delay, order) in [(0.01, 1), (0.01, 3), (2.0, 5), (1e-5, 8)] {
        let g = pade(delay, order).unwrap();
        assert_close(hinf_norm(&g, 1e-9).unwrap().gain, 1.0, 1e-8);
        let omega = 0.1 / delay;
        let phase = g.at(omega)[(0, 0)].arg();
        assert!((phase + 0.1).abs() < 1e-4, "order {order}: phase {phase}");
    }
    assert_eq!(pade(-0.01, 2).unwrap_err(), DelayError::Negative(-0.01));
    assert_eq!(pade(0.01, 0).unwrap_err(), DelayError::Order(0));
    assert_eq!(pade(0.0, 2).unwrap().states(), 0);
    // Order n matches the Taylor series of the delay up to the term 2n.
    let error = |order| (pade(1.0, order).unwrap().at(1.0)[(0, 0)] - c64::new(0.0, -1.0).exp()).norm();
    assert!(error(1) > 0.05 && error(2) < 2e-3 && error(3) < 1e-5 && error(4) < 1e-7);
}

#[test]
fn interconnections_agree_with_transfer_function_algebra() {
    let (g, h) = (tf(&[1.0, 2.0], &[1.0, 3.0, 5.0]), tf(&[2.0, 1.0], &[1.0, 4.0]));
    let s = c64::new(0.3, 1.7);
    let value = |x: &StateSpace| x.evaluate(s)[(0, 0)];
    let one = c64::new(1.0, 0.0);
    let (gv, hv) = (value(&g), value(&h));
    assert!((value(&series(&g, &h).unwrap()) - gv * hv).norm() < 1e-14);
    assert!((value(&parallel(&g, &h).unwrap()) - gv - hv).norm() < 1e-14);
    assert!((value(&feedback(&g, &h).unwrap()) - gv / (one + gv * hv)).norm() < 1e-14);
    // P = [1 g; 1 g] closed by k = −1 is 1/(1 + g).
    let p = StateSpace {
        a: g.a.clone(),
        b: Matrix::from_fn(2, 2, |i, j| if j == 1 { g.b[(i, 0)] } else { 0.0 }),
        c: Matrix::from_fn(2, 2, |_, j| g.c[(0, j)]),
        d: Matrix::from_fn(2, 2, |_, j| if j == 0 { 1.0 } else { 0.0 }),
    };
    let closed = lft_lower(&p, &StateSpace::gain(diagonal(&[-1.0]))).unwrap();
    assert!((value(&closed) - one / (one + gv)).norm() < 1e-14);
    assert!(
        lft_lower(
            &StateSpace::gain(Matrix::from_fn(2, 2, |_, _| 1.0)),
            &StateSpace::gain(diagonal(&[1.0]))
        )
        .is_err()
    );
    assert!(series(&append(&[g.clone(), h]), &g).is_err());
}

#[test]
fn bad_input_is_refused_with_the_reason() {
    assert_eq!(
        StateSpace::transfer_function(&[1.0, 0.0, 0.0], &[1.0, 1.0]).unwrap_err(),
        ModelError::Improper {
            numerator: 2,
            denominator: 1
        }
    );
    assert!(
        matches!(hinf_norm(&tf(&[1.0], &[1.0, -1.0]), 1e-6), Err(NormError::Unstable(a)) if (a - 1.0).abs() < 1e-12)
    );
    assert!(matches!(
        hinf_norm(&tf(&[1.0], &[1.0, 0.0]), 1e-6),
        Err(NormError::Unstable(0.0))
    ));
    assert!(
        StateSpace::new(
            Matrix::zeros(2, 2),
            Matrix::zeros(3, 1),
            Matrix::zeros(1, 2),
            Matrix::zeros(1, 1)
        )
        .is_err()
    );
    assert!(from_rows(&[vec![1.0], vec![f64::NAN]]).is_err());
}

/// Uncontrollable or unobservable unstable modes are named.
#[test]
fn fixed_unstable_modes_are_found() {
    let a = diagonal(&[1.0, -1.0, 0.5]);
    let b = Matrix::from_fn(3, 1, |i, _| if i == 2 { 0.0 } else { 1.0 });
    let c = Matrix::from_fn(1, 3, |_, j| if j == 0 { 0.0 } else { 1.0 });
    let g = StateSpace::new(a, b, c, Matrix::zeros(1, 1)).unwrap();
    let left = g.fixed_unstable_modes(true).unwrap();
    let right = g.fixed_unstable_modes(false).unwrap();
    assert!(left.len() == 1 && (left[0].re - 0.5).abs() < 1e-12);
    assert!(right.len() == 1 && (right[0].re - 1.0).abs() < 1e-12);
}
