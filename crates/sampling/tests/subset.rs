//! Subset simulation against events of known probability.

use sampling::design::Coordinate;
use sampling::distribution::{normal_cumulative, normal_quantile};
use sampling::subset::{Estimate, Settings, Subset};

/// Number of estimates compared with the truth.
const SEEDS: u64 = 25;

fn coordinates(seed: u64, count: usize) -> Vec<Coordinate> {
    (0..count)
        .map(|at| Coordinate::random(seed, &format!("x[{at}]")))
        .collect()
}

/// Runs one simulation with a score of independent standard normal numbers.
fn simulate(settings: Settings, seed: u64, count: usize, score: impl Fn(&[f64]) -> f64) -> Estimate {
    let mut subset = Subset::new(settings, seed, coordinates(seed, count)).unwrap();
    while let Some(batch) = subset.batch() {
        let z = |u: &Vec<f64>| u.iter().map(|u| normal_quantile(*u)).collect::<Vec<f64>>();
        let scores: Vec<f64> = batch.iter().map(|one| score(&z(&one.u))).collect();
        subset.submit_scores(&scores);
    }
    subset.estimate()
}

/// The mean over seeds, with the actual coefficient of variation of the estimates, and the mean of the reported one.
fn over_seeds(count: usize, score: impl Fn(&[f64]) -> f64) -> (f64, f64, f64, usize) {
    let all: Vec<Estimate> = (0..SEEDS)
        .map(|seed| simulate(Settings::default(), seed, count, &score))
        .collect();
    let of = |value: &dyn Fn(&Estimate) -> f64| all.iter().map(value).sum::<f64>() / all.len() as f64;
    let mean = of(&|one| one.probability);
    let variance = of(&|one| (one.probability - mean).powi(2));
    let points = all.iter().map(|one| one.points).max().unwrap_or(0);
    (mean, variance.sqrt() / mean, of(&|one| one.variation), points)
}

/// A plane at a distance: the probability is that of one normal number, in any number of dimensions.
#[test]
fn subset_estimate_beyond_plane_matches_exact_probability() {
    for (dimensions, distance) in [(1, 3.0), (2, 4.0), (10, 4.0), (30, 4.5), (3, 5.0)] {
        let truth = normal_cumulative(-distance);
        let root = (dimensions as f64).sqrt();
        let score = |z: &[f64]| z.iter().sum::<f64>() / root - distance;
        let (mean, real, stated, points) = over_seeds(dimensions, score);
        // The mean of the estimates has a smaller standard error than a single one.
        let away = (mean / truth - 1.0).abs() / (real / (SEEDS as f64).sqrt());
        assert!(
            away < 3.5,
            "{dimensions} at {distance}: {mean:e}, not {truth:e}: {away} deviations"
        );
        assert!(
            stated > 0.5 * real && stated < 1.6 * real,
            "{stated} is stated, {real} is true"
        );
        assert!(points < 7000, "{points}");
    }
}

/// Outside a circle in two dimensions: exp(-r²/2), in all directions. Two distant corners: the sum of both.
#[test]
fn subset_finds_circular_and_two_sided_events() {
    let (mean, real, ..) = over_seeds(2, |z| z[0].hypot(z[1]) - 4.5);
    let truth = (-0.5_f64 * 4.5 * 4.5).exp();
    assert!(
        (mean / truth - 1.0).abs() < 3.5 * real / (SEEDS as f64).sqrt(),
        "{mean:e}, not {truth:e}"
    );
    let (mean, real, ..) = over_seeds(2, |z| z[0].abs() - 4.0);
    let truth = 2.0 * normal_cumulative(-4.0);
    assert!(
        (mean / truth - 1.0).abs() < 3.5 * real / (SEEDS as f64).sqrt(),
        "{mean:e}, not {truth:e}"
    );
}

/// Points per level, simulations, dimensions, score and true probability.
type Case<'a> = (usize, u64, usize, &'a dyn Fn(&[f64]) -> f64, f64);

/// The 95 % interval contains the truth in 95 of 100 cases, with few points per level as with many, whatever the shape of the event.
#[test]
fn subset_interval_has_stated_coverage() {
    let plane = |distance: f64| move |z: &[f64]| z[0] - distance;
    let diagonal = |z: &[f64]| z.iter().sum::<f64>() / (z.len() as f64).sqrt() - 4.5;
    let circle = |z: &[f64]| z[0].hypot(z[1]) - 4.5;
    let corner = |z: &[f64]| z[0].min(z[1]) - 2.5;
    let above = |x: f64| normal_cumulative(-x);
    let cases: [Case; 7] = [
        (100, 200, 2, &plane(3.0), above(3.0)),
        (100, 200, 2, &plane(5.5), above(5.5)),
        (100, 200, 2, &circle, (-0.5_f64 * 4.5 * 4.5).exp()),
        (100, 20, 30, &diagonal, above(4.5)),
        (200, 100, 2, &corner, above(2.5).powi(2)),
        (500, 60, 2, &plane(4.0), above(4.0)),
        (1000, 60, 2, &corner, above(2.5).powi(2)),
    ];
    for (points, seeds, dimensions, score, truth) in cases {
        let settings = Settings {
            points,
            ..Settings::default()
        };
        let holds = (0..seeds).filter(|seed| {
            let [low, high] = simulate(settings, 1000 + seed, dimensions, score).interval;
            low <= truth && truth <= high
        });
        let share = holds.count() as f64 / seeds as f64;
        // Three standard deviations of a share of 95 %.
        let least = 0.95 - 3.0 * (0.95 * 0.05 / seeds as f64).sqrt();
        assert!(
            share >= least,
            "{points} points, {dimensions} dimensions, {truth:e}: {share}"
        );
    }
}

/// With few points the level probabilities are poorly known, and an unobserved event must not be reported as rarer than it is.
#[test]
fn subset_bound_of_unobserved_event_is_above_probability() {
    let truth = normal_cumulative(-3.775);
    let settings = Settings {
        points: 100,
        levels: 4,
        ..Settings::default()
    };
    let all = (0..400).map(|seed| simulate(settings, 5000 + seed, 1, |z| z[0] - 3.775));
    let never: Vec<f64> = all
        .filter(|one| one.probability == 0.0)
        .map(|one| one.interval[1])
        .collect();
    let below = never.iter().filter(|bound| **bound < truth).count();
    assert!(never.len() > 20, "{} of 400", never.len());
    assert!(
        below * 20 <= never.len(),
        "{below} of {} bounds are below {truth:e}",
        never.len()
    );
}

#[test]
fn subset_counts_frequent_event_in_one_level() {
    let estimate = simulate(Settings::default(), 3, 2, |z| z[0] - 1.0);
    assert_eq!((estimate.levels.len(), estimate.points), (1, 1000));
    let plain = (0..1000_u64)
        .filter(|k| normal_quantile(coordinates(3, 1)[0].at(*k)) > 1.0)
        .count();
    assert_eq!(
        estimate.probability,
        plain as f64 / 1000.0,
        "the first level is a plain random sample"
    );
}

/// The states of a single level are a plain random sample, so the interval is that of a proportion, up to a sample that misses always.
#[test]
fn subset_interval_of_one_level_is_that_of_a_proportion() {
    let settings = Settings {
        points: 100,
        ..Settings::default()
    };
    let always = simulate(settings, 1, 1, |z| z[0] + 10.0);
    assert_eq!(
        (always.probability, always.points, always.equivalent),
        (1.0, 100, 100.0)
    );
    // Wilson: 100 / (100 + 1.96²)
    assert!((always.interval[0] - 0.963).abs() < 1e-4, "{:?}", always.interval);
    assert_eq!(always.interval[1], 1.0);
    for (share, seeds) in [(0.98, 400), (0.5, 400)] {
        let event = normal_quantile(share);
        let all = (0..seeds).map(|seed| simulate(settings, 900 + seed, 1, |z| event - z[0]));
        let covered = all.filter(|one| (one.interval[0]..=one.interval[1]).contains(&share));
        let covered = covered.count();
        assert!(
            covered * 100 >= 92 * seeds as usize,
            "{covered} of {seeds} around {share}"
        );
    }
}

#[test]
fn subset_bounds_event_that_never_occurs() {
    let estimate = simulate(
        Settings {
            levels: 3,
            ..Settings::default()
        },
        1,
        1,
        |z| z[0] - 30.0,
    );
    assert_eq!(estimate.probability, 0.0);
    assert_eq!(estimate.levels.len(), 3);
    // Three in a thousand independent states of the last level, and more for the uncertainty of the levels before.
    let [low, high] = estimate.interval;
    assert!(low == 0.0 && (3e-5..3e-4).contains(&high), "{estimate:?}");
    assert!(estimate.centre.is_empty() && estimate.variation.is_infinite());
}

/// A binary score carries no distance to the event: there is no gain over direct Monte Carlo, and the estimate reports this.
#[test]
fn subset_with_binary_score_is_stuck_and_counts() {
    let estimate = simulate(Settings::default(), 5, 1, |z| if z[0] > 2.0 { 1.0 } else { -1.0 });
    assert!(estimate.stuck && estimate.levels.len() == 1, "{estimate:?}");
    assert!((estimate.probability - 0.0228).abs() < 0.02, "{}", estimate.probability);
}

/// Impossible points (NaN) are excluded from the first level and never accepted: the probability is that among the others.
#[test]
fn subset_excludes_impossible_points() {
    // Points below -1 are impossible: the true probability among the others is larger by 1 / P(z > -1).
    let score = |z: &[f64]| if z[0] < -1.0 { f64::NAN } else { z[0] - 3.5 };
    let (mean, real, ..) = over_seeds(1, score);
    let truth = normal_cumulative(-3.5) / normal_cumulative(1.0);
    assert!(
        (mean / truth - 1.0).abs() < 3.5 * real / (SEEDS as f64).sqrt(),
        "{mean:e}, not {truth:e}"
    );
}

#[test]
fn subset_centre_identifies_driving_coordinate() {
    let estimate = simulate(Settings::default(), 8, 4, |z| z[2] - 4.0);
    assert!((4.0..4.6).contains(&estimate.centre[2]), "{:?}", estimate.centre);
    for at in [0, 1, 3] {
        assert!(estimate.centre[at].abs() < 0.6, "{:?}", estimate.centre);
    }
}

#[test]
fn subset_exceedance_matches_distribution_up_to_event() {
    let curve = simulate(
        Settings {
            points: 4000,
            ..Settings::default()
        },
        2,
        2,
        |z| z[0] - 4.0,
    )
    .exceedance();
    assert!(curve.windows(2).all(|two| two[0].0 <= two[1].0 && two[0].1 >= two[1].1));
    for (score, part) in curve.iter().filter(|(_, part)| *part > 5e-5) {
        let truth = normal_cumulative(-(score + 4.0));
        assert!((part / truth).ln().abs() < 0.5, "{score}: {part:e}, not {truth:e}");
    }
}

/// The same scores give the same points, and another seed gives others.
#[test]
fn subset_points_depend_only_on_seed_names_and_scores() {
    let run = |seed| {
        let mut all = Vec::new();
        let mut subset = Subset::new(Settings::default(), seed, coordinates(seed, 2)).unwrap();
        while let Some(batch) = subset.batch() {
            all.extend(batch.to_vec());
            let scores: Vec<f64> = batch.iter().map(|one| one.u[0] + one.u[1] - 1.99).collect();
            subset.submit_scores(&scores);
        }
        all
    };
    let (one, other) = (run(1), run(2));
    assert_eq!(one, run(1));
    assert_ne!(one[0], other[0]);
    assert!(one.iter().enumerate().all(|(at, point)| point.number == at));
    assert!(one.iter().all(|point| point.parent.is_none() == (point.level == 0)));
}

#[test]
fn subset_rejects_invalid_settings() {
    let refused = |points, share, levels| {
        let settings = Settings { points, share, levels };
        Subset::new(settings, 1, coordinates(1, 1)).unwrap_err().parameter
    };
    assert_eq!(refused(1000, 0.3, 8), "share");
    assert_eq!(refused(1000, 0.0, 8), "share");
    assert_eq!(refused(1000, 0.9, 8), "share");
    assert_eq!(refused(1005, 0.1, 8), "points");
    assert_eq!(refused(90, 0.1, 8), "points");
    assert_eq!(refused(1000, 0.1, 0), "levels");
}
