//! Tuning problems with an infimum that no gain attains, or with nothing to minimise: the report is correct and states this.

use synthesis::full_order::full_order_optimum;
use synthesis::linalg::{CMatrix, Matrix, c64, singular_values};
use synthesis::matrices::PlantMatrices;
use synthesis::tuner::{Options, Problem, SearchControl, Tuned, Verdict, tune};
use twofloat::TwoFloat;

fn plant(json: &str) -> PlantMatrices {
    serde_json::from_str(json).unwrap()
}

fn tuned(plant: &PlantMatrices, starts: usize) -> (Problem, Tuned) {
    let problem = plant.static_output_feedback().unwrap();
    let options = Options {
        starts,
        ..Options::default()
    };
    let result = tune(&problem, &options, &|_| SearchControl::Continue).unwrap();
    (problem, result)
}

/// The gain at ω of the first model in 31 digits, from the equations as they stand: `A + B K C` is never formed.
fn true_gain(problem: &Problem, k: &Matrix, omega: f64) -> f64 {
    let p = &problem.models[0].plant;
    let (n, nu, ny) = (p.states(), k.nrows(), k.ncols());
    let (nw, nz) = (p.inputs() - nu, p.outputs() - ny);
    let size = n + nu + ny;
    let number = TwoFloat::from;
    let mut rows = vec![vec![number(0.0); 2 * size + nw]; 2 * size];
    let mut set = |i: usize, j: usize, value: f64| {
        rows[i][j] = number(value);
        rows[size + i][size + j] = number(value);
    };
    for i in 0..n {
        (0..n).for_each(|j| set(i, j, -p.a[(i, j)]));
        (0..nu).for_each(|j| set(i, n + j, -p.b[(i, nw + j)]));
    }
    for i in 0..nu {
        set(n + i, n + i, 1.0);
        (0..ny).for_each(|j| set(n + i, n + nu + j, -k[(i, j)]));
    }
    for i in 0..ny {
        set(n + nu + i, n + nu + i, 1.0);
        (0..n).for_each(|j| set(n + nu + i, j, -p.c[(nz + i, j)]));
        (0..nu).for_each(|j| set(n + nu + i, n + j, -p.d[(nz + i, nw + j)]));
    }
    for i in 0..n {
        rows[i][size + i] = number(-omega);
        rows[size + i][i] = number(omega);
        (0..nw).for_each(|w| rows[i][2 * size + w] = number(p.b[(i, w)]));
    }
    for i in 0..ny {
        (0..nw).for_each(|w| rows[n + nu + i][2 * size + w] = number(p.d[(nz + i, w)]));
    }
    for column in 0..2 * size {
        let pivot = (column..2 * size)
            .max_by(|&i, &j| rows[i][column].hi().abs().total_cmp(&rows[j][column].hi().abs()))
            .unwrap();
        rows.swap(column, pivot);
        let head = rows[column].clone();
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = row[column] / head[column];
            if i == column || factor.hi() == 0.0 {
                continue;
            }
            (column..row.len()).for_each(|j| row[j] -= factor * head[j]);
        }
    }
    let x = |i: usize, w: usize| rows[i][2 * size + w] / rows[i][i];
    let z = CMatrix::from_fn(nz, nw, |i, w| {
        let part = |first: usize, direct: f64| {
            let states = (0..n).fold(number(direct), |sum, s| sum + x(first + s, w) * number(p.c[(i, s)]));
            (0..nu)
                .fold(states, |sum, u| sum + x(first + n + u, w) * number(p.d[(i, nw + u)]))
                .hi()
        };
        c64::new(part(0, p.d[(i, w)]), part(size, 0.0))
    });
    singular_values(&z).unwrap()[0]
}

/// No frequency of a grid over sixteen decades has a gain above the reported one, which is attained at the reported frequency.
fn check_reported(problem: &Problem, t: &Tuned) {
    let k = &t.controllers[0];
    let points = if problem.models[0].plant.states() > 6 { 20 } else { 60 };
    let highest = (0..16 * points)
        .map(|i| true_gain(problem, k, 10f64.powf(-6.0 + f64::from(i) / f64::from(points))))
        .fold(0.0, f64::max);
    assert!(
        highest <= t.evaluation.gamma * (1.0 + 1e-6),
        "reported {}, true {highest}",
        t.evaluation.gamma
    );
    let peak = t.evaluation.channels[0].omega;
    if peak.is_finite() {
        let there = true_gain(problem, k, peak);
        assert!((there - t.evaluation.gamma).abs() <= 1e-6 * there, "{there} at {peak}");
    }
    // The result is no better than the best of the starts, which was evaluated in the same way.
    let best = t.starts.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(best, t.evaluation.gamma);
}

/// Two problems of the COMPleib collection (F. Leibfritz) that lead a search to large gains; the infimum of the first lies at
/// infinite gain.
#[test]
fn runaway_gains_are_reported_with_their_true_norm() {
    let (problem, t) = tuned(&plant(include_str!("data/nn1.json")), 8);
    check_reported(&problem, &t);
    assert!(
        matches!(t.verdict, Verdict::InfiniteGain { .. }),
        "{:?} {:?}",
        t.verdict,
        t.gains
    );
    assert!(t.verdict.to_string().contains("effort weight"));
    let (problem, t) = tuned(&plant(include_str!("data/ac16.json")), 8);
    check_reported(&problem, &t);
    // Best known: 14.856.
    assert!(t.evaluation.gamma < 14.857, "{}", t.evaluation.gamma);
}

/// ẋ = x + w + u, z = y = x: gamma is 1/|1 + k| and decreases without attaining its infimum.
#[test]
fn gamma_that_falls_for_ever_is_no_optimum() {
    let p = plant(r#"{"A":[[1]],"B1":[[1]],"B":[[1]],"C1":[[1]],"C":[[1]]}"#);
    let (problem, t) = tuned(&p, 3);
    check_reported(&problem, &t);
    assert!(t.gains[0][(0, 0)].abs() <= 1e10, "{:?}", t.gains);
    assert!(matches!(t.verdict, Verdict::InfiniteGain { .. }), "{:?}", t.verdict);
    // With an effort weight and a stable plant an optimum exists: gamma² = (1 + k²)/(1 − k)² is least at k = −1.
    let weighted = PlantMatrices {
        a: vec![vec![-1.0]],
        c1: vec![vec![1.0], vec![0.0]],
        d12: vec![vec![0.0], vec![1.0]],
        ..p
    };
    let (_, t) = tuned(&weighted, 3);
    assert_eq!(t.verdict, Verdict::Attained);
    assert!(
        (t.evaluation.gamma - 0.5f64.sqrt()).abs() < 1e-6,
        "{}",
        t.evaluation.gamma
    );
}

/// First-order plants whose gamma, √(1 + k²)/(|k| − a) or 1/(|k| − a) with noise, falls as the gain grows. At gains of a million its
/// slope is lost in rounding error. The last plant has a second loop, whose gain is limited on both sides.
#[test]
fn flat_infimum_at_infinite_gain_is_no_optimum() {
    let mut plants: Vec<String> = [0.0, 0.1, 0.3, 0.5, 1.0, 2.0, 5.0]
        .iter()
        .map(|a| format!(r#"{{"A":[[{a}]],"B1":[[1]],"B":[[1]],"C1":[[1],[0]],"C":[[1]],"D12":[[0],[1]]}}"#))
        .collect();
    plants.push(r#"{"A":[[1]],"B1":[[1,0]],"B":[[1]],"C1":[[1]],"C":[[1]],"D21":[[0,1]]}"#.into());
    plants.push(
        r#"{"A":[[1,0],[0,0.5]],"B1":[[1,0,0],[0,1,0]],"B":[[1,0],[0,1]],"C1":[[1,0],[0,0],[0,0.1],[0,0]],"C":[[1,0],[0,1]],
            "D12":[[0,0],[1,0],[0,0],[0,0.1]],"D21":[[0,0,0],[0,0,0.1]]}"#
            .into(),
    );
    for json in &plants {
        let (_, t) = tuned(&plant(json), 8);
        assert!(
            matches!(t.verdict, Verdict::InfiniteGain { .. }),
            "{json}: {:?} {:?} {:?}",
            t.verdict,
            t.gains,
            t.evaluation.gamma
        );
    }
}

/// With an effort weight and a noise on every measurement gamma is at least their product with the gain: an optimum is attained, also
/// where gamma hardly falls before it, as in the first plant.
#[test]
fn attained_optima_at_large_gains_are_optima() {
    let flat =
        r#"{"A":[[0.3]],"B1":[[1,0]],"B":[[1.5]],"C1":[[0.5],[0]],"C":[[1]],"D12":[[0],[0.25]],"D21":[[0,6e-5]]}"#;
    let (_, t) = tuned(&plant(flat), 3);
    assert!(t.controllers[0][(0, 0)] < -100.0, "{:?}", t.controllers);
    assert_eq!(t.verdict, Verdict::Attained, "{:?}", t.controllers);
    let mut large = 0;
    for seed in 0..50 {
        let mut next_random = random_numbers(1000 + seed);
        let n = 1 + (seed % 3) as usize;
        let (nu, ny) = (1 + (seed / 3 % 2) as usize, 1 + (seed / 6 % 2) as usize);
        let mut rows = |height: usize, width: usize| -> Vec<Vec<f64>> {
            (0..height)
                .map(|_| (0..width).map(|_| 2.0 * next_random()).collect())
                .collect()
        };
        let (effort, noise) = (
            10f64.powi(-((seed % 5) as i32) / 2),
            10f64.powi(-((seed % 4) as i32) / 2),
        );
        let unit = |at: bool, size: f64| if at { size } else { 0.0 };
        let mut c1 = rows(1, n);
        c1.extend(vec![vec![0.0; n]; nu]);
        let mut b1 = rows(n, 1);
        b1.iter_mut().for_each(|row| row.extend(vec![0.0; ny]));
        let mut a = rows(n, n);
        (0..n).for_each(|i| a[i][i] -= 1.0);
        let p = PlantMatrices {
            name: "random".into(),
            a,
            b1,
            b: rows(n, nu),
            c1,
            c: rows(ny, n),
            d12: (0..=nu)
                .map(|i| (0..nu).map(|j| unit(i == j + 1, effort)).collect())
                .collect(),
            d21: (0..ny)
                .map(|i| (0..=ny).map(|j| unit(j == i + 1, noise)).collect())
                .collect(),
            ..PlantMatrices::default()
        };
        let problem = p.static_output_feedback().unwrap();
        // Some of these no static gain stabilises.
        let Ok(t) = tune(&problem, &Options::default(), &|_| SearchControl::Continue) else {
            continue;
        };
        assert!(
            !matches!(t.verdict, Verdict::InfiniteGain { .. }),
            "{seed}: {} {:?} {:?}",
            t.verdict,
            t.controllers,
            t.starts
        );
        large += usize::from(synthesis::linalg::max_abs(&t.controllers[0]) > 30.0);
    }
    assert!(large >= 3, "{large}");
}

#[test]
fn zero_norm_is_reported_as_nothing_to_minimise() {
    for json in [
        // No output.
        r#"{"A":[[-1]],"B1":[[1]],"B":[[1]],"C1":[[0]],"C":[[1]]}"#,
        // No disturbance, and an unstable plant that must still be stabilised.
        r#"{"A":[[1,1],[0,-2]],"B1":[[0],[0]],"B":[[1],[0]],"C1":[[1,0]],"C":[[1,0]]}"#,
        // A disturbance of an unobservable mode.
        r#"{"A":[[-1,0],[0,-2]],"B1":[[0],[1]],"B":[[1],[0]],"C1":[[1,0]],"C":[[1,0]]}"#,
    ] {
        let (_, t) = tuned(&plant(json), 2);
        assert_eq!(t.evaluation.gamma, 0.0, "{json}");
        assert_eq!(t.verdict, Verdict::NothingToMinimise, "{json}");
        assert!(t.evaluation.abscissa < 0.0);
    }
}

/// z = x + 0.3 u is zero for u = -x / 0.3, and for no other gain.
#[test]
fn gains_that_cancel_the_disturbance_attain_zero() {
    let json = r#"{"A":[[0,1],[2,-0.4]],"B1":[[0],[1]],"B":[[0],[1]],"C1":[[1,0]],"C":[[1,0],[0,1]],"D12":[[0.3]]}"#;
    let (_, t) = tuned(&plant(json), 8);
    assert!(t.evaluation.gamma < 1e-6, "{}", t.evaluation.gamma);
    assert_eq!(t.verdict, Verdict::Attained, "{}", t.verdict);
    assert!(
        (t.controllers[0][(0, 0)] + 1.0 / 0.3).abs() < 1e-4,
        "{:?}",
        t.controllers
    );
}

/// Infima with a pole on the axis: a one-state plant with gamma = |k| for k < −1, and a double integrator with unweighted
/// position.
#[test]
fn infimum_on_the_axis_is_no_optimum() {
    for json in [
        r#"{"A":[[1]],"B1":[[1]],"B":[[1]],"C1":[[1]],"C":[[1]],"D12":[[1]],"D21":[[1]]}"#,
        r#"{"A":[[0,1],[0,0]],"B1":[[0],[1]],"B":[[0],[1]],"C1":[[0,1],[0,0]],"C":[[1,0],[0,1]],"D12":[[0],[1]]}"#,
    ] {
        let (problem, t) = tuned(&plant(json), 8);
        check_reported(&problem, &t);
        assert!(
            matches!(t.verdict, Verdict::PoleNearAxis { .. }),
            "{:?} {:?} {:?}",
            t.verdict,
            t.gains,
            t.starts
        );
        assert!(t.evaluation.abscissa < -1e-10, "{}", t.evaluation.abscissa);
    }
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

/// State feedback of many states attains the optimum of all controllers, which the Riccati equations give. The states are
/// measured in other coordinates, and with a vanishing noise for the comparison.
#[test]
fn state_feedback_of_many_states_reaches_the_optimum() {
    for (n, seed) in [(6, 1), (10, 2), (10, 5), (12, 3), (12, 4)] {
        let mut next_random = random_numbers(seed);
        let mut rows = |height: usize, width: usize| -> Vec<Vec<f64>> {
            (0..height)
                .map(|_| (0..width).map(|_| next_random()).collect())
                .collect()
        };
        let (nw, nu) = (3, 2);
        let mut c1 = rows(n, n);
        c1.truncate(3);
        c1.extend(vec![vec![0.0; n]; nu]);
        let d12 = (0..3 + nu)
            .map(|i| (0..nu).map(|j| f64::from(u8::from(i == 3 + j))).collect())
            .collect();
        let mut p = PlantMatrices {
            name: "random".into(),
            a: rows(n, n),
            b1: rows(n, nw),
            b: rows(n, nu),
            c1,
            c: rows(n, n),
            d12,
            ..PlantMatrices::default()
        };
        let (problem, t) = tuned(&p, 2);
        check_reported(&problem, &t);
        for row in &mut p.b1 {
            row.extend(vec![0.0; n]);
        }
        p.d21 = (0..n)
            .map(|i| (0..nw + n).map(|j| if j == nw + i { 1e-6 } else { 0.0 }).collect())
            .collect();
        let (low, high) = full_order_optimum(&p.plant().unwrap(), nu, n, 1e-6).unwrap();
        let gamma = t.evaluation.gamma;
        assert!(
            gamma <= high * (1.0 + 1e-4),
            "{n} states: {gamma} above {low}..{high}, starts {:?}",
            t.starts
        );
        assert!(gamma >= low * (1.0 - 1e-3), "{n} states: {gamma} below {low}..{high}");
    }
}

#[test]
fn misspelt_key_is_refused() {
    let read = |extra: &str| {
        serde_json::from_str::<PlantMatrices>(&format!(
            r#"{{"A":[[-1]],"B1":[[1]],"B":[[1]],"C1":[[1]],"C":[[1]]{extra}}}"#
        ))
        .map_err(|e| e.to_string())
    };
    assert!(read(r#","source":"a book","nx":1,"nw":1,"nu":1,"nz":1,"ny":1"#).is_ok());
    let error = read(r#","D2l":[[1]]"#).unwrap_err();
    assert!(error.starts_with("D2l: unknown key; known are A, B1"), "{error}");
    let error = read(r#","nz":2"#).unwrap_err();
    assert!(error.starts_with("nz: 2 stated, but C1 has 1 rows"), "{error}");
}
