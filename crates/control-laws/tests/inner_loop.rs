//! Properties of the inner loop that hold for every gain, bound, period and error history.

use control_laws::inner::{Bound, Discretisation, FeedbackLaw, Gains, InnerLoop};
use control_laws::{Dof, Matrix13};
use proptest::prelude::*;

fn conditional(bound: Bound, discretisation: Discretisation) -> FeedbackLaw {
    FeedbackLaw::ConditionalIntegrator { bound, discretisation }
}

fn channels(range: std::ops::Range<f64>) -> impl Strategy<Value = Dof> {
    proptest::collection::vec(range, 13).prop_map(|values| Dof::from_row_slice(&values))
}

/// Errors that step, rest and reverse, which drive the integrator into and out of saturation.
fn errors() -> impl Strategy<Value = Vec<Dof>> {
    proptest::collection::vec(
        (
            channels(-1.0..1.0),
            prop_oneof![Just(0.0), Just(0.01), Just(1.0), Just(30.0)],
        ),
        60,
    )
    .prop_map(|list| list.into_iter().map(|(direction, size)| direction * size).collect())
}

/// A symmetric positive definite matrix: a diagonal plus smaller off-diagonal entries.
fn coupled_matrix(diagonal: &Dof, coupling: f64) -> Matrix13 {
    Matrix13::from_fn(|row, column| {
        let mean = (diagonal[row] * diagonal[column]).sqrt();
        if row == column {
            mean
        } else {
            mean * coupling / (1.0 + row.abs_diff(column) as f64)
        }
    })
}

/// Any matrix with entries of about one.
fn matrices() -> impl Strategy<Value = Matrix13> {
    proptest::collection::vec(-1.0..1.0, 169).prop_map(|values| Matrix13::from_row_slice(&values))
}

/// Largest residual of `K_P (σ⁺ − σ)/T = −K_I σ⁺ + sat(K_I σ⁺ + K_P y)`, and the size of its terms.
fn implicit_residual(
    kp: &Matrix13,
    ki: &Matrix13,
    period_s: f64,
    before: &Dof,
    error: &Dof,
    bound: &Dof,
    after: &Dof,
) -> (f64, f64) {
    let wanted = ki * after + kp * error;
    let force = wanted.zip_map(bound, |value, bound| value.clamp(-bound, bound));
    let (rate, integral) = (kp * (after - before) / period_s, ki * after);
    let sizes = (kp.abs() * (after.abs() + before.abs()) / period_s).amax() + (ki.abs() * after.abs()).amax();
    ((rate + integral - force).amax(), sizes + force.amax() + 1e-9)
}

proptest! {
    #[test]
    fn integral_action_never_exceeds_the_bound_for_any_period(
        kp in channels(0.1..500.0), ki in channels(0.0..500.0), bound in channels(0.01..400.0),
        period_s in prop_oneof![1e-4..0.1, 0.1..1e3], errors in errors(),
    ) {
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let mut inner = InnerLoop::new(Gains::diagonal(&kp, &ki), &law, period_s).unwrap();
        for error in errors {
            let feedback = inner.step(&error);
            for channel in 0..13 {
                let action = ki[channel] * inner.sigma()[channel];
                prop_assert!(action.abs() <= bound[channel] * (1.0 + 1e-14), "{action} of {}", bound[channel]);
                prop_assert!(feedback.force[channel].abs() <= bound[channel]);
            }
        }
    }

    #[test]
    fn integrator_below_saturation_is_the_pi_law_bit_for_bit(
        kp in channels(0.1..500.0), ki in channels(0.0..500.0), coupling in prop_oneof![Just(0.0), 0.05..0.15], errors in errors(),
    ) {
        let gains = Gains::full(coupled_matrix(&kp, coupling), coupled_matrix(&ki, coupling));
        let law = conditional(Bound::Scalar(1e9), Discretisation::Exact);
        let bounded = InnerLoop::new(gains, &law, 0.01);
        prop_assume!(bounded.is_ok()); // couplings whose step may have several solutions are refused
        let mut bounded = bounded.unwrap();
        let mut plain = InnerLoop::new(gains, &FeedbackLaw::ProportionalIntegral, 0.01).unwrap();
        for error in errors {
            prop_assert_eq!(bounded.step(&error), plain.step(&error));
            prop_assert_eq!(bounded.sigma(), plain.sigma());
        }
    }

    #[test]
    fn fixed_point_matches_closed_form_for_near_diagonal_gains(
        kp in channels(0.5..500.0), ki in channels(0.1..200.0), bound in channels(0.01..100.0), errors in errors(),
    ) {
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let mut closed = InnerLoop::new(Gains::diagonal(&kp, &ki), &law, 0.01).unwrap();
        let mut off_diagonal = Matrix13::from_diagonal(&kp);
        off_diagonal[(0, 1)] = 1e-300; // takes the general path with the same numbers
        let gains = Gains::full(off_diagonal, Matrix13::from_diagonal(&ki));
        prop_assert!(!gains.is_diagonal());
        let mut iterated = InnerLoop::new(gains, &law, 0.01).unwrap();
        for error in errors {
            let (a, b) = (closed.step(&error), iterated.step(&error));
            prop_assert!(b.converged);
            prop_assert!((a.force - b.force).component_div(&bound).amax() < 1e-10);
            prop_assert!((closed.sigma() - iterated.sigma()).amax() < 1e-9 * (1.0 + closed.sigma().amax()));
        }
    }

    #[test]
    fn full_matrices_satisfy_the_implicit_equation(
        kp in channels(1.0..300.0), ki in channels(0.1..100.0), coupling in 0.05..0.15, bound in channels(0.1..50.0), errors in errors(),
    ) {
        let (kp, ki) = (coupled_matrix(&kp, coupling), coupled_matrix(&ki, coupling));
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let mut inner = InnerLoop::new(Gains::full(kp, ki), &law, 0.01).unwrap();
        for error in errors {
            let before = *inner.sigma();
            let feedback = inner.step(&error);
            let after = inner.sigma();
            prop_assert!(feedback.converged);
            // K_P (σ⁺ − σ)/T = −K_I σ⁺ + u: Eq 7 at the end of the period
            let residual = kp * (after - before) / 0.01 + ki * after - feedback.force;
            let scale = (kp * (after - before) / 0.01).amax() + (ki * after).amax() + 1e-9;
            prop_assert!(residual.amax() < 1e-9 * scale, "{} of {scale}", residual.amax());
        }
    }

    /// `K_P = M^½ X M^½`: with X a multiple of one it is that multiple of M, and with a full X its pencil with M has the eigenvalues
    /// of X. In saturation the implicit equation holds with that K_P.
    #[test]
    fn scheduled_gains_follow_the_mass_matrix(
        masses in channels(0.1..500.0), coupling in 0.05..0.15, x in channels(0.5..20.0), ki in channels(0.1..100.0),
        bound in channels(0.1..50.0), errors in errors(),
    ) {
        let mass = coupled_matrix(&masses, coupling);
        let x = coupled_matrix(&x, 0.1);
        let mut like_mass = InnerLoop::new(
            Gains::scheduled(Matrix13::identity() * 3.0, &ki), &FeedbackLaw::Proportional, 0.01,
        ).unwrap();
        prop_assert!(like_mass.is_scheduled());
        like_mass.schedule(&mass);
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let mut inner = InnerLoop::new(Gains::scheduled(x, &ki), &law, 0.01).unwrap();
        let mut open = InnerLoop::new(Gains::scheduled(x, &ki), &FeedbackLaw::Proportional, 0.01).unwrap();
        open.schedule(&mass);
        let columns: Vec<Dof> = (0..13).map(|k| open.step(&Dof::from_fn(|i, _| f64::from(u8::from(i == k)))).force).collect();
        let kp = Matrix13::from_columns(&columns);
        let half = mass.cholesky().unwrap().l().try_inverse().unwrap();
        let pencil = (half * kp * half.transpose()).symmetric_eigenvalues().sum();
        prop_assert!((pencil - x.trace()).abs() < 1e-9 * x.trace(), "{pencil} against {}", x.trace());
        prop_assert!(((kp - kp.transpose()).amax()) < 1e-9 * kp.amax());
        for error in errors {
            let force = like_mass.step(&error).force;
            prop_assert!((force - mass * error * 3.0).amax() <= 1e-9 * (1.0 + force.amax()));
            let before = *inner.sigma();
            inner.schedule(&mass);
            let feedback = inner.step(&error);
            let after = inner.sigma();
            prop_assert!(feedback.converged);
            let ki = Matrix13::from_diagonal(&ki);
            let residual = kp * (after - before) / 0.01 + ki * after - feedback.force;
            let scale = (kp * (after - before) / 0.01).amax() + (ki * after).amax() + 1e-9;
            if feedback.saturated.contains(&true) {
                prop_assert!(residual.amax() < 1e-7 * scale, "{} of {scale}", residual.amax());
            }
        }
    }

    /// Unrelated K_P and K_I, T K_I / K_P from 1e-6 to 1e8: cases in which the fixed-point iteration diverges.
    #[test]
    fn saturated_step_is_solved_for_any_diagonal_ki(
        factor in matrices(), exponents in channels(-3.0..6.0), bounds in channels(-2.0..2.0), errors in errors(), period_s in 1e-3..1.0,
    ) {
        let power = |exponents: &Dof| exponents.map(|x| libm::pow(10.0, x));
        let (kp, ki, bound) = (factor * factor.transpose() + Matrix13::identity() * 0.01, power(&exponents), power(&bounds));
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let mut inner = InnerLoop::new(Gains::full(kp, Matrix13::from_diagonal(&ki)), &law, period_s).unwrap();
        for error in errors {
            let before = *inner.sigma();
            let feedback = inner.step(&error);
            prop_assert!(feedback.converged);
            let (worst, of) = implicit_residual(&kp, &Matrix13::from_diagonal(&ki), period_s, &before, &error, &bound, inner.sigma());
            prop_assert!(worst < 1e-7 * of, "{worst} of {of}");
        }
    }

    /// With couplings in K_I the step may have several solutions; such gains are rejected, and all others are solved.
    #[test]
    fn full_ki_is_refused_or_its_saturated_step_solved(
        factor in matrices(), other in matrices(), size in prop_oneof![0.1..1.0, 1.0..1e3], bound in channels(0.1..50.0), errors in errors(),
    ) {
        let kp = factor * factor.transpose() + Matrix13::identity() * 3.0;
        let ki = (other * other.transpose() + Matrix13::identity() * 3.0) * size;
        let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
        let Ok(mut inner) = InnerLoop::new(Gains::full(kp, ki), &law, 0.1) else { return Ok(()) };
        for error in errors {
            let before = *inner.sigma();
            prop_assert!(inner.step(&error).converged);
            let (worst, of) = implicit_residual(&kp, &ki, 0.1, &before, &error, &bound, inner.sigma());
            prop_assert!(worst < 1e-7 * of, "{worst} of {of}");
        }
    }

    #[test]
    fn discretisations_converge_to_the_differential_equation(
        kp in channels(1.0..100.0), ratio in channels(0.1..3.0), bound in channels(0.1..10.0),
    ) {
        let gains = Gains::diagonal(&kp, &kp.component_mul(&ratio));
        let error = |time_s: f64| Dof::from_fn(|channel, _| libm::sin(time_s + channel as f64));
        let run = |discretisation, period_s: f64| {
            let mut inner = InnerLoop::new(gains, &conditional(Bound::PerChannel(bound), discretisation), period_s).unwrap();
            for tick in 0..(2.0 / period_s).round() as u32 {
                inner.step(&error(f64::from(tick) * period_s));
            }
            *inner.sigma()
        };
        let fine = run(Discretisation::Exact, 1e-4);
        for discretisation in [Discretisation::Exact, Discretisation::Euler] {
            let coarse = (run(discretisation, 4e-3) - fine).amax();
            let finer = (run(discretisation, 1e-3) - fine).amax();
            prop_assert!(coarse < 0.02 && finer < 0.006, "{discretisation:?}: {coarse} {finer}");
        }
    }
}

/// Two channels with T K_I / K_P of about 18 and 14, and eleven with small values: here the fixed-point iteration never converges.
#[test]
fn step_is_solved_where_the_fixed_point_diverges() {
    let (mass, x) = (
        coupled_matrix(&Dof::repeat(0.1), 0.05),
        coupled_matrix(&Dof::repeat(0.5), 0.1),
    );
    let mut ki = Dof::repeat(0.1);
    (ki[11], ki[12]) = (92.142_731_884_197_83, 68.227_139_140_897_69);
    let mut error = Dof::zeros();
    error[11] = 0.995_026_498_143_993_2;
    let bound = Dof::repeat(0.1);
    let law = conditional(Bound::PerChannel(bound), Discretisation::Exact);
    let mut inner = InnerLoop::new(Gains::scheduled(x, &ki), &law, 0.01).unwrap();
    inner.schedule(&mass);
    let feedback = inner.step(&error);
    assert!(feedback.converged && feedback.saturated[11]);
    let mut open = InnerLoop::new(Gains::scheduled(x, &ki), &FeedbackLaw::Proportional, 0.01).unwrap();
    open.schedule(&mass);
    let columns: Vec<Dof> = (0..13)
        .map(|k| open.step(&Dof::from_fn(|i, _| f64::from(u8::from(i == k)))).force)
        .collect();
    let kp = Matrix13::from_columns(&columns);
    let ki = Matrix13::from_diagonal(&ki);
    let (worst, of) = implicit_residual(&kp, &ki, 0.01, &Dof::zeros(), &error, &bound, inner.sigma());
    assert!(worst < 1e-13 * of, "{worst} of {of}");
}

/// K_P⁻¹ = [1 9; 9 100] and K_I⁻¹ = [100 9; 9 1] in the first two channels: with the first alone in saturation the determinant is
/// `19 − 80 T`.
#[test]
fn couplings_without_a_single_solution_are_refused() {
    let mut kp = Matrix13::identity();
    let mut ki = Matrix13::identity();
    for (matrix, [a, b, c]) in [(&mut kp, [1.0, 9.0, 100.0]), (&mut ki, [100.0, 9.0, 1.0])] {
        let determinant = a * c - b * b;
        matrix[(0, 0)] = c / determinant;
        matrix[(1, 1)] = a / determinant;
        (matrix[(0, 1)], matrix[(1, 0)]) = (-b / determinant, -b / determinant);
    }
    let law = conditional(Bound::Scalar(1.0), Discretisation::Exact);
    let field = |law: &FeedbackLaw, period_s: f64| {
        InnerLoop::new(Gains::full(kp, ki), law, period_s)
            .map(drop)
            .map_err(|error| error.field)
    };
    assert_eq!(field(&law, 0.2), Ok(()));
    assert_eq!(field(&law, 0.3), Err("inner.ki"));
    assert_eq!(
        field(&FeedbackLaw::ProportionalIntegral, 0.3),
        Ok(()),
        "it has no implicit step"
    );
}

#[test]
fn forward_euler_leaves_the_bound_where_the_exact_step_does_not() {
    let gains = Gains::diagonal(&Dof::repeat(1.0), &Dof::repeat(5.0));
    let worst = |discretisation| {
        let mut inner = InnerLoop::new(gains, &conditional(Bound::Scalar(1.0), discretisation), 0.35).unwrap();
        let mut worst = 0.0_f64;
        for tick in 0..40 {
            inner.step(&Dof::repeat(if tick % 20 < 10 { 3.0 } else { -3.0 }));
            worst = worst.max(5.0 * inner.sigma()[0].abs());
        }
        worst
    };
    assert!(worst(Discretisation::Exact) <= 1.0);
    assert!(worst(Discretisation::Euler) > 1.3);
}

#[test]
fn feedback_reverses_at_once_after_saturation_but_pi_lags() {
    let gains = Gains::diagonal(&Dof::repeat(2.0), &Dof::repeat(1.0));
    let recovery = |law| {
        let mut inner = InnerLoop::new(gains, &law, 0.01).unwrap();
        for _ in 0..3000 {
            inner.step(&Dof::repeat(1.0));
        }
        (0..10_000)
            .take_while(|_| inner.step(&Dof::repeat(-1.0)).force[0] > 0.0)
            .count()
    };
    assert_eq!(recovery(conditional(Bound::Scalar(1.0), Discretisation::Exact)), 0);
    assert!(recovery(FeedbackLaw::ProportionalIntegral) > 2000, "wind-up");
}

#[test]
fn proportional_law_has_no_state() {
    let gains = Gains::diagonal(&Dof::repeat(2.0), &Dof::repeat(1.0));
    let mut inner = InnerLoop::new(gains, &FeedbackLaw::Proportional, 0.01).unwrap();
    for _ in 0..10 {
        assert_eq!(inner.step(&Dof::repeat(0.5)).force, Dof::repeat(1.0));
    }
    assert_eq!(*inner.sigma(), Dof::zeros());
}

#[test]
fn gains_and_bounds_out_of_range_are_refused_with_the_field() {
    let good = Dof::repeat(1.0);
    let with = |index: usize, value: f64| {
        let mut gains = good;
        gains[index] = value;
        gains
    };
    let field = |kp: &Dof, ki: &Dof, bound: f64| {
        let law = conditional(Bound::Scalar(bound), Discretisation::Exact);
        InnerLoop::new(Gains::diagonal(kp, ki), &law, 0.01)
            .map(drop)
            .map_err(|error| error.field)
    };
    assert_eq!(field(&with(4, 0.0), &good, 1.0), Err("inner.kp"));
    assert_eq!(field(&with(4, f64::NAN), &good, 1.0), Err("inner.kp"));
    assert_eq!(field(&good, &with(12, -0.1), 1.0), Err("inner.ki"));
    assert_eq!(field(&good, &good, 0.0), Err("inner.bound"));
    assert_eq!(field(&good, &with(12, 0.0), 1.0), Ok(()));
}
