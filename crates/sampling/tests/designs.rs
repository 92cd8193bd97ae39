//! Guaranteed properties of the designs.

mod common;

use common::scipy;
use sampling::design::{Coordinate, DIMENSIONS, unscrambled_sobol};

/// The centred L2 discrepancy (F. J. Hickernell, 1998).
fn discrepancy(points: &[Vec<f64>]) -> f64 {
    let (n, d) = (points.len() as f64, points[0].len() as i32);
    let c = |x: f64| (x - 0.5).abs();
    let single = |x: &Vec<f64>| -> f64 { x.iter().map(|x| 1.0 + 0.5 * c(*x) - 0.5 * c(*x) * c(*x)).product() };
    let pair = |x: &Vec<f64>, y: &Vec<f64>| -> f64 {
        let both = x.iter().zip(y);
        both.map(|(x, y)| 1.0 + 0.5 * c(*x) + 0.5 * c(*y) - 0.5 * (x - y).abs())
            .product()
    };
    let pairs: f64 = points
        .iter()
        .map(|x| points.iter().map(|y| pair(x, y)).sum::<f64>())
        .sum();
    (13.0_f64 / 12.0).powi(d) - 2.0 / n * points.iter().map(single).sum::<f64>() + pairs / (n * n)
}

fn points(axes: &[Coordinate], n: u64) -> Vec<Vec<f64>> {
    (0..n).map(|k| axes.iter().map(|axis| axis.at(k)).collect()).collect()
}

#[test]
fn unscrambled_sobol_points_match_scipy() {
    for (k, row) in scipy()["sobol"].as_array().unwrap().iter().enumerate() {
        for (dimension, expected) in row.as_array().unwrap().iter().enumerate() {
            let own = unscrambled_sobol(dimension, k as u64).map(u64::from);
            assert_eq!(own, expected.as_u64(), "point {k}, dimension {dimension}");
        }
    }
    assert_eq!(unscrambled_sobol(DIMENSIONS, 1), None);
}

#[test]
fn scrambled_sobol_has_one_point_per_elementary_interval() {
    for dimension in [0, 1, 17, DIMENSIONS - 1] {
        let axis = Coordinate::sobol(3, "x", dimension).unwrap();
        for block in 0..3 {
            let mut seen = [false; 256];
            (0..256).for_each(|k| seen[(axis.at(256 * block + k) * 256.0) as usize] = true);
            assert!(seen.iter().all(|one| *one), "dimension {dimension}, block {block}");
        }
    }
}

#[test]
fn scrambled_sobol_discrepancy_is_that_of_scipy() {
    let known = &scipy()["discrepancy"];
    let number = |name: &str| known[name].as_f64().unwrap();
    let plain: Vec<Vec<f64>> = (0..256)
        .map(|k| {
            (0..5)
                .map(|d| f64::from(unscrambled_sobol(d, k).unwrap()) / 2_f64.powi(32))
                .collect()
        })
        .collect();
    let own = discrepancy(&plain);
    assert!((own - number("sobol-256-5")).abs() < 1e-12, "{own}");
    for seed in 0..5 {
        let axes: Vec<Coordinate> = (0..5)
            .map(|d| Coordinate::sobol(seed, &format!("x{d}"), d).unwrap())
            .collect();
        let own = discrepancy(&points(&axes, 256));
        assert!(own < 1.2 * number("scrambled-256-5"), "{own}");
    }
    let axes: Vec<Coordinate> = (0..5).map(|d| Coordinate::random(1, &format!("x{d}"))).collect();
    let own = discrepancy(&points(&axes, 256));
    assert!((0.5..2.0).contains(&(own / number("random-256-5"))), "{own}");
}

#[test]
fn latin_hypercube_has_one_point_in_each_stratum() {
    let n = 1000;
    let axes: Vec<Coordinate> = (0..4)
        .map(|d| Coordinate::latin_hypercube(1, &format!("x{d}"), n))
        .collect();
    for axis in &axes {
        let mut seen = vec![false; n as usize];
        (0..n).for_each(|k| seen[(axis.at(k) * n as f64) as usize] = true);
        assert!(seen.iter().all(|one| *one));
    }
    let column = |at: usize| -> Vec<f64> { (0..n).map(|k| axes[at].at(k)).collect() };
    let rho = sampling::statistics::correlation(&column(0), &column(1)).unwrap();
    assert!(rho.abs() < 0.1, "{rho}");
}

#[test]
fn coordinate_depends_only_on_seed_name_and_number() {
    let a = Coordinate::random(1, "mass[0]");
    let b = Coordinate::random(1, "delay[0]");
    let values = |axis: &Coordinate| -> Vec<f64> { (0..10_000).map(|k| axis.at(k)).collect() };
    assert_eq!(a.at(7), Coordinate::random(1, "mass[0]").at(7));
    assert_ne!(a.at(7), Coordinate::random(2, "mass[0]").at(7));
    let rho = sampling::statistics::correlation(&values(&a), &values(&b)).unwrap();
    assert!(rho.abs() < 0.03, "{rho}");
    // the scramblings of two dimensions are independent
    let (a, b) = (
        Coordinate::sobol(1, "a", 4).unwrap(),
        Coordinate::sobol(1, "b", 4).unwrap(),
    );
    assert_ne!(a.at(0), b.at(0));
    for axis in [&a, &b, &Coordinate::latin_hypercube(1, "c", 3)] {
        assert!((0..10_000).all(|k| axis.at(k) > 0.0 && axis.at(k) < 1.0));
    }
}

/// The numbers of a campaign must not change: existing tables are matched by them.
#[test]
fn coordinates_match_documented_draws() {
    let axes = [
        Coordinate::random(1, "mass[0]"),
        Coordinate::latin_hypercube(1, "mass[0]", 200),
        Coordinate::sobol(1, "mass[0]", 3).unwrap(),
    ];
    let own: Vec<[f64; 2]> = axes.iter().map(|axis| [axis.at(0), axis.at(137)]).collect();
    assert_eq!(own, DOCUMENTED);
}

const DOCUMENTED: [[f64; 2]; 3] = [
    [0.27884223492885296, 0.1341354902271109],
    [0.13639421117464426, 0.3106706774511355],
    [0.4194681761504249, 0.6837265119268875],
];
