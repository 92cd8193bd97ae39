//! Samples against their distributions: quantiles of SciPy, Kolmogorov-Smirnov test, moments, correlations.

mod common;

use common::{numbers, scipy};
use sampling::design::Coordinate;
use sampling::distribution::*;

const N: u64 = 10_000;
/// √N times the Kolmogorov-Smirnov distance exceeds this with a probability of 0.001.
const KOLMOGOROV: f64 = 1.95;

fn draws(scalar: Scalar, name: &str) -> Vec<f64> {
    let coordinate = Coordinate::random(7, name);
    (0..N).map(|k| scalar.quantile(coordinate.at(k))).collect()
}

/// The Kolmogorov-Smirnov distance, times √n.
fn distance(mut values: Vec<f64>, cumulative: impl Fn(f64) -> f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len() as f64;
    let apart = values.iter().enumerate().map(|(at, value)| {
        let own = cumulative(*value);
        (own - at as f64 / n).abs().max((own - (at + 1) as f64 / n).abs())
    });
    apart.fold(0.0, f64::max) * n.sqrt()
}

fn cases() -> Vec<(&'static str, Scalar)> {
    vec![
        ("uniform", Scalar::Uniform { from: -2.0, to: 3.0 }),
        (
            "normal",
            Scalar::Normal {
                mean: 3.0,
                deviation: 0.5,
            },
        ),
        (
            "truncated",
            Scalar::TruncatedNormal {
                mean: 3.0,
                deviation: 0.5,
                from: 2.0,
                to: 3.2,
            },
        ),
        (
            "upper-tail",
            Scalar::TruncatedNormal {
                mean: 0.0,
                deviation: 1.0,
                from: 6.0,
                to: 9.0,
            },
        ),
        (
            "log-normal",
            Scalar::LogNormal {
                median: 2.0,
                log_deviation: 0.3,
            },
        ),
        (
            "triangular",
            Scalar::Triangular {
                from: 1.0,
                mode: 2.0,
                to: 6.0,
            },
        ),
    ]
}

#[test]
fn scalar_quantiles_match_scipy() {
    let all = &scipy()["quantiles"];
    let u = numbers(&all["u"]);
    let close = |own: f64, other: f64| (own - other).abs() <= 1e-13 * other.abs().max(1e-3);
    for (u, expected) in u.iter().zip(numbers(&all["standard"])) {
        let own = normal_quantile(*u);
        assert!(close(own, expected), "normal quantile of {u}: {own}, not {expected}");
        assert!(close(normal_cumulative(own), *u) || *u < 1e-20, "{u}");
    }
    for (name, scalar) in cases() {
        scalar.check().unwrap();
        for (u, expected) in u[3..u.len() - 1].iter().zip(numbers(&all[name])) {
            let own = scalar.quantile(*u);
            let near = (own - expected).abs() <= 1e-9 * expected.abs().max(1e-3);
            assert!(near, "{name} at {u}: {own}, not {expected}");
        }
    }
}

#[test]
fn draws_follow_their_distributions() {
    for (name, scalar) in cases() {
        // The distribution function by bisection of the quantile, which is checked against SciPy's values.
        let cumulative = |x: f64| {
            let (mut low, mut high) = (0.0_f64, 1.0_f64);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if scalar.quantile(middle) < x {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            0.5 * (low + high)
        };
        let own = distance(draws(scalar, name), cumulative);
        assert!(own < KOLMOGOROV, "{name}: {own}");
    }
    let (mean, deviation) = sampling::statistics::moments(&draws(cases()[1].1, "normal")).unwrap();
    assert!(
        (mean - 3.0).abs() < 0.02 && (deviation - 0.5).abs() < 0.015,
        "{mean} {deviation}"
    );
    let logs: Vec<f64> = draws(cases()[4].1, "log-normal").iter().map(|x| x.ln()).collect();
    let (mean, deviation) = sampling::statistics::moments(&logs).unwrap();
    assert!((mean - 2.0_f64.ln()).abs() < 0.012 && (deviation - 0.3).abs() < 0.01);
}

#[test]
fn weighted_choice_follows_weights() {
    let weights = Weights::new(&[1.0, 0.0, 3.0, 4.0, 0.0]).unwrap();
    let coordinate = Coordinate::random(3, "choice");
    let mut counts = [0; 5];
    (0..N).for_each(|k| counts[weights.choice(coordinate.at(k))] += 1);
    assert_eq!((counts[1], counts[4]), (0, 0));
    for (count, part) in [(counts[0], 0.125), (counts[2], 0.375), (counts[3], 0.5)] {
        assert!((f64::from(count) / N as f64 - part).abs() < 0.02, "{counts:?}");
    }
    assert_eq!((weights.choice(1e-300), weights.choice(1.0 - 1e-16)), (0, 3));
}

#[test]
fn correlated_draws_have_their_correlations() {
    let rows = [vec![1.0, 0.8, -0.3], vec![0.8, 1.0, 0.1], vec![-0.3, 0.1, 1.0]];
    let law = Correlated::new(&[1.0, 2.0, 3.0], &[0.1, 0.2, 0.0], Some(&rows)).unwrap();
    let axes: Vec<Coordinate> = (0..3).map(|at| Coordinate::random(1, &format!("c{at}"))).collect();
    let all: Vec<Vec<f64>> = (0..N)
        .map(|k| law.quantile(&axes.iter().map(|axis| axis.at(k)).collect::<Vec<_>>()))
        .collect();
    let column = |at: usize| -> Vec<f64> { all.iter().map(|row| row[at]).collect() };
    for (at, (mean, deviation)) in [(1.0, 0.1), (2.0, 0.2)].into_iter().enumerate() {
        let own = distance(column(at), |x| normal_cumulative((x - mean) / deviation));
        assert!(own < KOLMOGOROV, "{own}");
    }
    assert!(column(2).iter().all(|value| *value == 3.0), "no deviation, one number");
    let rho = sampling::statistics::correlation(&column(0), &column(1)).unwrap();
    assert!((rho - 0.8).abs() < 0.01, "{rho}");
    // a number determined by the others is possible, one that contradicts them is not
    let same = [vec![1.0, 1.0], vec![1.0, 1.0]];
    assert!(Correlated::new(&[0.0; 2], &[1.0; 2], Some(&same)).is_ok());
    let wrong = [vec![1.0, 0.9, 0.9], vec![0.9, 1.0, -0.9], vec![0.9, -0.9, 1.0]];
    for (rows, part) in [
        (&wrong[..], "contradicts itself"),
        (&same[..], "3 rows"),
        (
            &[vec![1.0, 0.5, 0.0], vec![0.4, 1.0, 0.0], vec![0.0, 0.0, 1.0]],
            "not symmetric",
        ),
    ] {
        let error = Correlated::new(&[0.0; 3], &[1.0; 3], Some(rows)).unwrap_err();
        assert!(error.reason.contains(part), "{error:?}");
    }
}

#[test]
fn directions_and_rotations_are_uniform() {
    let axes: Vec<Coordinate> = (0..3).map(|at| Coordinate::random(5, &format!("d{at}"))).collect();
    let u = |k: u64| [axes[0].at(k), axes[1].at(k), axes[2].at(k)];
    let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    // each coordinate of a point on a sphere is uniform (Archimedes)
    for at in 0..3 {
        let values = (0..N).map(|k| on_sphere([u(k)[0], u(k)[1]])[at]).collect();
        assert!(distance(values, |x| 0.5 * (x + 1.0)) < KOLMOGOROV);
    }
    // and so is, in a cone, the cosine of the angle to its axis
    let (axis, angle) = ([1.0, -2.0, 0.5], 0.2_f64);
    let unit = axis.map(|x| x / length(&axis).sqrt());
    let along = |k| -> f64 {
        in_cone(axis, angle, [u(k)[0], u(k)[1]])
            .iter()
            .zip(unit)
            .map(|(a, b)| a * b)
            .sum()
    };
    let cosines: Vec<f64> = (0..N).map(along).collect();
    assert!(cosines.iter().all(|cosine| *cosine >= angle.cos() - 1e-12));
    assert!(distance(cosines, |x| (x - angle.cos()) / (1.0 - angle.cos())) < KOLMOGOROV);
    // for a random rotation, the angle has the density (1 - cos a)/π, and a rotated vector is uniform
    let rotations: Vec<Quaternion> = (0..N).map(|k| random_rotation(u(k))).collect();
    assert!(rotations.iter().all(|q| (length(q) - 1.0).abs() < 1e-12 && q[0] >= 0.0));
    let angles = rotations.iter().map(|q| 2.0 * q[0].clamp(-1.0, 1.0).acos()).collect();
    assert!(distance(angles, |a| (a - a.sin()) / std::f64::consts::PI) < KOLMOGOROV);
    for at in 0..3 {
        let turned = rotations.iter().map(|q| rotate(*q, [0.6, 0.0, 0.8])[at]).collect();
        assert!(distance(turned, |x| 0.5 * (x + 1.0)) < KOLMOGOROV);
    }
}

#[test]
fn roll_pitch_yaw_conversion_round_trips() {
    let angles = [0.3, -0.7, 2.0];
    let q = from_roll_pitch_yaw(angles);
    let back = roll_pitch_yaw(q);
    assert!(back.iter().zip(angles).all(|(a, b)| (a - b).abs() < 1e-14), "{back:?}");
    // about x first, then the fixed y: x stays in the plane x-z
    let v = rotate(
        from_roll_pitch_yaw([0.5, std::f64::consts::FRAC_PI_2, 0.0]),
        [1.0, 0.0, 0.0],
    );
    assert!((v[2] + 1.0).abs() < 1e-15, "{v:?}");
    // two small turns about one axis add up
    let once = rotation_from_vector([0.0, 0.02, 0.0]);
    let twice = compose(once, once);
    assert!((roll_pitch_yaw(twice)[1] - 0.04).abs() < 1e-15);
    let axes: Vec<Coordinate> = (0..3).map(|at| Coordinate::random(5, &format!("m{at}"))).collect();
    let about_x: Vec<f64> = (0..N)
        .map(|k| misalignment(0.001, [axes[0].at(k), axes[1].at(k), axes[2].at(k)])[0])
        .collect();
    assert!(distance(about_x, |x| normal_cumulative(x / 0.001)) < KOLMOGOROV);
}

#[test]
fn dispersed_inertias_are_physical() {
    let axes: Vec<Coordinate> = (0..6).map(|at| Coordinate::random(9, &format!("i{at}"))).collect();
    // nearly a plate: independent normal errors of 10 % would violate the triangle inequality half of the time
    let plate = [1.0, 1.0, 1.99];
    assert!(moments_are_physical(plate) && !moments_are_physical([1.0, 1.0, 2.1]));
    let wide = Inertia {
        log_deviation: 0.3,
        rotation_deviation: 0.0,
    };
    for k in 0..N {
        let moments = wide.moments(plate, [axes[0].at(k), axes[1].at(k), axes[2].at(k)]);
        assert!(moments_are_physical(moments), "{moments:?}");
    }
    // the median sample is the nominal body
    let same = wide.moments(plate, [0.5; 3]);
    assert!(same.iter().zip(plate).all(|(a, b)| (a - b).abs() < 1e-15));
    let turned = Inertia {
        log_deviation: 0.1,
        rotation_deviation: 0.05,
    };
    let own = [3.0, 4.0, 5.0, 0.1, -0.2, 0.3];
    let same = turned.matrix(own, [0.5; 6]);
    assert!(same.iter().zip(own).all(|(a, b)| (a - b).abs() < 1e-14), "{same:?}");
    for k in 0..N {
        let u: [f64; 6] = std::array::from_fn(|at| axes[at].at(k));
        let [xx, yy, zz, xy, xz, yz] = turned.matrix(own, u);
        // Sylvester's criterion for the second moments
        let half = 0.5 * (xx + yy + zz);
        let (a, b, c) = (half - xx, half - yy, half - zz);
        let whole = a * (b * c - yz * yz) - xy * (xy * c + yz * xz) - xz * (xy * yz + b * xz);
        assert!(a > 0.0 && a * b - xy * xy > 0.0 && whole > 0.0, "{k}");
    }
}

#[test]
fn invalid_distribution_names_its_parameter() {
    let normal = |deviation| Scalar::Normal { mean: 0.0, deviation };
    for (scalar, parameter) in [
        (normal(0.0), "deviation"),
        (normal(f64::NAN), "deviation"),
        (Scalar::Uniform { from: 1.0, to: 1.0 }, "to"),
        (
            Scalar::Triangular {
                from: 0.0,
                mode: 3.0,
                to: 2.0,
            },
            "mode",
        ),
        (
            Scalar::LogNormal {
                median: -1.0,
                log_deviation: 0.1,
            },
            "median",
        ),
        (
            Scalar::TruncatedNormal {
                mean: 0.0,
                deviation: 1.0,
                from: 50.0,
                to: 51.0,
            },
            "from",
        ),
    ] {
        assert_eq!(scalar.check().unwrap_err().parameter, parameter);
    }
    assert!(Weights::new(&[0.0, 0.0]).is_err() && Weights::new(&[1.0, -1.0]).is_err() && Weights::new(&[]).is_err());
}

/// There are such numbers, but their probability is too small to be drawn from: the bound is named, and how far away it is.
#[test]
fn far_bound_of_truncated_normal_is_refused_for_its_distance() {
    let check = |from: f64, to: f64| {
        let refused = Scalar::TruncatedNormal {
            mean: 1.0,
            deviation: 2.0,
            from,
            to,
        }
        .check();
        refused.map_err(|error| (error.parameter, error.reason))
    };
    for (from, to, parameter, words) in [
        (f64::NEG_INFINITY, -69.0, "to", "-69 is 35 deviations below the mean 1"),
        (71.0, f64::INFINITY, "from", "71 is 35 deviations above the mean 1"),
    ] {
        let (wrong, reason) = check(from, to).unwrap_err();
        assert_eq!(wrong, parameter);
        assert!(reason.contains(words) && reason.contains("33"), "{reason}");
    }
    assert!(check(f64::NEG_INFINITY, -65.0).is_ok() && check(67.0, f64::INFINITY).is_ok());
    let (wrong, reason) = check(1.0, 1.0 + f64::EPSILON).unwrap_err();
    assert!(wrong == "to" && reason.contains("too close"), "{wrong}: {reason}");
}
