//! The tuner on problems with a closed-form optimum, and on bad input.

use std::sync::atomic::{AtomicUsize, Ordering};

use synthesis::linalg::{Matrix, diagonal, from_rows, to_rows};
use synthesis::matrices::PlantMatrices;
use synthesis::norm::hinf_norm;
use synthesis::state_space::StateSpace;
use synthesis::tuner::{
    Channel, GainBlock, GainError, GainKind, Model, Options, Phase, Problem, SearchControl, TuneError, evaluate, tune,
};

fn assert_close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "found {found:.10}, expected {expected:.10}"
    );
}

fn matrices(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]]) -> PlantMatrices {
    let rows = |m: &[&[f64]]| m.iter().map(|r| r.to_vec()).collect::<Vec<_>>();
    let n = a.len();
    let nu = b[0].len();
    let unit = |i: usize, n: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    // Disturbance on every state; all states and all inputs are performance outputs.
    PlantMatrices {
        name: "test".into(),
        a: rows(a),
        b1: (0..n).map(|i| unit(i, n)).collect(),
        b: rows(b),
        c1: (0..n + nu).map(|i| unit(i, n)).collect(),
        c: rows(c),
        d11: Vec::new(),
        d12: (0..n + nu)
            .map(|i| if i < n { vec![0.0; nu] } else { unit(i - n, nu) })
            .collect(),
        d21: Vec::new(),
        d22: Vec::new(),
        start: None,
    }
}

fn tune_silently(problem: &Problem, options: &Options) -> Result<synthesis::tuner::Tuned, TuneError> {
    tune(problem, options, &|_| SearchControl::Continue)
}

/// ẋ = a x + w + u, z = (x, u), u = k x with a < 0: the norm is √(1 + k²)/|a + k| at zero frequency, least at k = 1/a,
/// where it is 1/√(1 + a²).
#[test]
fn scalar_state_feedback_in_closed_form() {
    let problem = matrices(&[&[-2.0]], &[&[1.0]], &[&[1.0]])
        .static_output_feedback()
        .unwrap();
    let t = tune_silently(&problem, &Options::default()).unwrap();
    assert_close(t.evaluation.gamma, 1.0 / 5f64.sqrt(), 1e-6);
    assert_close(t.gains[0][(0, 0)], -0.5, 1e-3);
    assert!(t.certificate.length < 1e-3, "{:?}", t.certificate);
}

/// Static feedback of the whole state reaches what any controller can reach that sees the state (Doyle, Glover, Khargonekar
/// and Francis 1989): the tuner and the two Riccati equations, which share nothing, must give the same number.
#[test]
fn state_feedback_reaches_the_full_information_optimum() {
    let p = matrices(
        &[&[0.0, 1.0], &[0.0, 0.0]],
        &[&[0.0], &[1.0]],
        &[&[1.0, 0.0], &[0.0, 1.0]],
    );
    let t = tune_silently(
        &p.static_output_feedback().unwrap(),
        &Options {
            starts: 4,
            ..Options::default()
        },
    )
    .unwrap();
    // The same plant with both states measured through a vanishing noise.
    let mut noisy = p.clone();
    for row in &mut noisy.b1 {
        row.extend([0.0, 0.0]);
    }
    noisy.d21 = vec![vec![0.0, 0.0, 1e-4, 0.0], vec![0.0, 0.0, 0.0, 1e-4]];
    let (low, high) = synthesis::full_order::full_order_optimum(&noisy.plant().unwrap(), 1, 2, 1e-5).unwrap();
    assert!(
        t.evaluation.gamma >= low * (1.0 - 1e-3),
        "{} below {low}",
        t.evaluation.gamma
    );
    assert_close(t.evaluation.gamma, high, 5e-3);
}

/// A nonsmooth optimum: two channels that pull one positive gain in opposite directions meet where they are equal. With
/// u = −k y on 1/s: channel one is 1/k (disturbance to output), channel two k/10 (noise to control), equal at √10.
#[test]
fn two_channels_meet_at_a_kink() {
    let plant = StateSpace::new(
        from_rows(&[vec![0.0]]).unwrap(),
        from_rows(&[vec![1.0, 0.0, -1.0]]).unwrap(),
        from_rows(&[vec![1.0], vec![0.0], vec![1.0]]).unwrap(),
        from_rows(&[vec![0.0, 0.0, 0.0], vec![0.0, 0.0, 0.1], vec![0.0, 1.0, 0.0]]).unwrap(),
    )
    .unwrap();
    let channel = |name: &str, outputs, inputs| Channel {
        name: name.into(),
        outputs,
        inputs,
    };
    let model = Model {
        name: "integrator".into(),
        plant,
        controls: 1,
        measurements: 1,
        channels: vec![channel("load", 0..1, 0..1), channel("noise", 1..2, 1..2)],
        transforms: vec![None],
    };
    let gain = GainBlock {
        name: "k".into(),
        kind: GainKind::PositiveDiagonal(1),
        row: 0,
        column: 0,
        start: diagonal(&[0.2]),
        unit: 1.0,
    };
    let problem = Problem {
        models: vec![model.clone()],
        gains: vec![gain.clone()],
    };
    let t = tune_silently(
        &problem,
        &Options {
            starts: 1,
            ..Options::default()
        },
    )
    .unwrap();
    assert_close(t.gains[0][(0, 0)], 10f64.sqrt(), 1e-4);
    assert_close(t.evaluation.gamma, 1.0 / 10f64.sqrt(), 1e-4);
    // At the kink each gradient of ln γ has length one; only their combination vanishes.
    assert!(
        t.certificate.length < 1e-3 && t.certificate.steepest > 0.9,
        "{:?}",
        t.certificate
    );
    // Two models, one with four times the noise weight: the meeting point moves to √10/2.
    let mut second = model;
    second.name = "noisy".into();
    second.plant.d[(1, 2)] *= 4.0;
    let both = Problem {
        models: vec![problem.models[0].clone(), second],
        gains: vec![gain],
    };
    let t = tune_silently(
        &both,
        &Options {
            starts: 1,
            ..Options::default()
        },
    )
    .unwrap();
    assert_close(t.gains[0][(0, 0)], 10f64.sqrt() / 2.0, 1e-4);
}

/// M v̇ = −K v + d in coordinates of energy: performance is M^½ v, disturbance M^½ d, so that every mass matrix looks alike.
fn of_mass(mass: [[f64; 2]; 2]) -> Model {
    let m = from_rows(&[mass[0].to_vec(), mass[1].to_vec()]).unwrap();
    let root = synthesis::linalg::sqrt_spd(&m).unwrap();
    let inverse_root = synthesis::linalg::inverse(&root).unwrap();
    let inverse = synthesis::linalg::inverse(&m).unwrap();
    let b = synthesis::linalg::blocks(&[&[&inverse_root, &Matrix::zeros(2, 2), &(inverse * -1.0)]]);
    let c = synthesis::linalg::blocks(&[&[&root], &[&Matrix::zeros(2, 2)], &[&Matrix::identity(2, 2)]]);
    let mut d = Matrix::zeros(6, 6);
    for i in 0..2 {
        for j in 0..2 {
            d[(2 + i, 4 + j)] = 0.1 * inverse_root[(i, j)];
            d[(4 + i, 2 + j)] = inverse_root[(i, j)];
        }
    }
    Model {
        name: format!("{mass:?}"),
        plant: StateSpace::new(Matrix::zeros(2, 2), b, c, d).unwrap(),
        controls: 2,
        measurements: 2,
        channels: vec![
            Channel {
                name: "load".into(),
                outputs: 0..2,
                inputs: 0..2,
            },
            Channel {
                name: "noise".into(),
                outputs: 2..4,
                inputs: 2..4,
            },
        ],
        transforms: vec![Some((root.clone(), root))],
    }
}

/// Positive definite and transformed gains: with M v̇ = −K v + d and the scheduled form K = M^½ X M^½ one X serves several
/// mass matrices, where a constant K cannot. The optimum of each block is known by symmetry: X is a multiple of I.
#[test]
fn a_scheduled_gain_serves_two_mass_matrices() {
    let start = from_rows(&[vec![1.0, 0.4], vec![0.4, 0.5]]).unwrap();
    let gain = GainBlock {
        name: "X".into(),
        kind: GainKind::PositiveDefinite(vec![2]),
        row: 0,
        column: 0,
        start,
        unit: 1.0,
    };
    let models = vec![of_mass([[1.0, 0.2], [0.2, 1.0]]), of_mass([[9.0, -1.0], [-1.0, 0.3]])];
    let mut problem = Problem {
        models,
        gains: vec![gain],
    };
    let t = tune_silently(
        &problem,
        &Options {
            starts: 1,
            tolerance: 1e-7,
            ..Options::default()
        },
    )
    .unwrap();
    assert_close(t.evaluation.gamma, 1.0 / 10f64.sqrt(), 1e-3);
    assert_close(t.gains[0][(0, 0)], 10f64.sqrt(), 5e-3);
    assert_close(t.gains[0][(1, 1)], 10f64.sqrt(), 5e-3);
    assert!(t.gains[0][(0, 1)].abs() < 0.03);
    // Threads share the models of one start without influence on the result.
    let threads = |threads| {
        let options = Options {
            starts: 1,
            threads,
            ..Options::default()
        };
        tune(&problem, &options, &|_| SearchControl::Continue).unwrap()
    };
    let (one, two) = (threads(1), threads(2));
    assert_eq!(to_rows(&one.gains[0]), to_rows(&two.gains[0]));
    assert_eq!(one.certificate, two.certificate);
    // At this kink the certificate is tight: no step of a factor e promises a hundredth of a per cent.
    assert!(
        t.certificate.length < 1e-4 * t.certificate.steepest,
        "{:?}",
        t.certificate
    );
    // The same with a constant gain is several times worse.
    problem.models.iter_mut().for_each(|m| m.transforms = vec![None]);
    let constant = tune_silently(
        &problem,
        &Options {
            starts: 2,
            ..Options::default()
        },
    )
    .unwrap();
    assert!(
        constant.evaluation.gamma > 2.0 * t.evaluation.gamma,
        "{}",
        constant.evaluation.gamma
    );
}

/// Stabilisation from an unstable start, the same bits for the same seed whatever the number of threads, and progress.
#[test]
fn the_same_seed_gives_the_same_gains() {
    let p = matrices(
        &[&[0.0, 1.0, 0.0], &[2.0, 0.3, 1.0], &[0.5, 0.0, -1.0]],
        &[&[0.0], &[1.0], &[0.5]],
        &[&[1.0, 0.0, 0.2], &[0.0, 1.0, 0.0]],
    );
    let problem = p.static_output_feedback().unwrap();
    let seen = AtomicUsize::new(0);
    let run = |threads| {
        let options = Options {
            starts: 3,
            threads,
            seed: 5,
            ..Options::default()
        };
        tune(&problem, &options, &|progress| {
            if progress.phase == Phase::Stabilise {
                seen.fetch_add(1, Ordering::Relaxed);
            }
            SearchControl::Continue
        })
        .unwrap()
    };
    let (one, two) = (run(1), run(3));
    assert_eq!(to_rows(&one.gains[0]), to_rows(&two.gains[0]));
    assert_eq!(one.starts, two.starts);
    assert!(
        seen.load(Ordering::Relaxed) > 0,
        "the open loop is unstable: there must be a stabilising phase"
    );
    assert!(one.evaluation.abscissa < 0.0);
    // The reported values equal those of an independent evaluation of the gains.
    let k = StateSpace::gain(one.controllers[0].clone());
    let closed = synthesis::interconnect::lft_lower(&problem.models[0].plant, &k).unwrap();
    assert_close(hinf_norm(&closed, 1e-9).unwrap().gain, one.evaluation.gamma, 1e-7);
    let again = Problem {
        gains: vec![GainBlock {
            start: one.gains[0].clone(),
            ..problem.gains[0].clone()
        }],
        ..problem
    };
    assert_close(evaluate(&again).unwrap().gamma, one.evaluation.gamma, 1e-7);
}

/// Stopping keeps the best gains so far.
#[test]
fn stopping_keeps_the_best_so_far() {
    let problem = matrices(&[&[0.0, 1.0], &[-1.0, -0.1]], &[&[0.0], &[1.0]], &[&[0.0, 1.0]])
        .static_output_feedback()
        .unwrap();
    let start = evaluate(&problem).unwrap().gamma;
    let count = AtomicUsize::new(0);
    let t = tune(
        &problem,
        &Options {
            starts: 5,
            threads: 1,
            ..Options::default()
        },
        &|_| {
            if count.fetch_add(1, Ordering::Relaxed) >= 2 {
                SearchControl::Stop
            } else {
                SearchControl::Continue
            }
        },
    )
    .unwrap();
    assert!(t.stopped && t.evaluation.gamma < start);
    assert!(t.starts[1..].iter().all(|g| g.is_infinite()), "{:?}", t.starts);
}

#[test]
fn bad_input_is_refused_with_the_reason() {
    // A mode at 1 that no input moves, then one that no output sees.
    let p = matrices(&[&[1.0, 0.0], &[0.0, -1.0]], &[&[0.0], &[1.0]], &[&[1.0, 0.0]])
        .static_output_feedback()
        .unwrap();
    assert!(
        matches!(tune_silently(&p, &Options::default()), Err(TuneError::NotStabilisable { mode, .. }) if (mode.re - 1.0).abs() < 1e-12)
    );
    let p = matrices(&[&[1.0, 0.0], &[0.0, -1.0]], &[&[1.0], &[1.0]], &[&[0.0, 1.0]])
        .static_output_feedback()
        .unwrap();
    assert!(matches!(
        tune_silently(&p, &Options::default()),
        Err(TuneError::NotDetectable { .. })
    ));
    // Stabilisable by some controller, not by a static gain: the double integrator from its position. The least abscissa
    // is zero, and the message says so.
    let p = matrices(&[&[0.0, 1.0], &[0.0, 0.0]], &[&[0.0], &[1.0]], &[&[1.0, 0.0]])
        .static_output_feedback()
        .unwrap();
    let error = tune_silently(
        &p,
        &Options {
            starts: 2,
            ..Options::default()
        },
    )
    .unwrap_err();
    assert!(
        matches!(error, TuneError::NotStabilised { abscissa, starts: 2, .. } if (0.0..1e-3).contains(&abscissa)),
        "{error}"
    );
    assert!(error.to_string().contains("spectral abscissa"));
    // Start gains outside their structure.
    let mut problem = matrices(&[&[-1.0]], &[&[1.0]], &[&[1.0]])
        .static_output_feedback()
        .unwrap();
    problem.gains[0].kind = GainKind::PositiveDefinite(vec![1]);
    problem.gains[0].start = diagonal(&[-3.0]);
    assert!(matches!(
        tune_silently(&problem, &Options::default()),
        Err(TuneError::Gain(GainError::NotPositiveDefinite { least, .. })) if least == -3.0
    ));
    problem.models[0].channels[0].outputs = 0..9;
    problem.gains[0].start = diagonal(&[3.0]);
    assert!(matches!(
        tune_silently(&problem, &Options::default()),
        Err(TuneError::Misfit { .. })
    ));
    problem.models.clear();
    assert_eq!(
        tune_silently(&problem, &Options::default()).unwrap_err(),
        TuneError::Empty("model")
    );
}
