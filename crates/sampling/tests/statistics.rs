//! Statistics against SciPy, and against functions with known results.

mod common;

use common::{numbers, scipy};
use sampling::design::Coordinate;
use sampling::distribution::normal_quantile;
use sampling::statistics::{indices, percentile, rank_bounds, ranks, spearman};

#[test]
fn rank_correlation_with_ties_matches_scipy() {
    let known = &scipy()["spearman"];
    let own = spearman(&numbers(&known["x"]), &numbers(&known["y"])).unwrap();
    assert!((own - known["rho"].as_f64().unwrap()).abs() < 1e-14, "{own}");
    assert_eq!(ranks(&[3.0, 1.0, 3.0]), [2.5, 1.0, 2.5]);
    assert_eq!(spearman(&[1.0, 1.0, 1.0], &[1.0, 2.0, 3.0]), None);
}

#[test]
fn rank_bounds_match_scipy_binomial_distribution() {
    for row in scipy()["ranks"].as_array().unwrap() {
        let row = numbers(row);
        let own = rank_bounds(row[0] as usize, row[1], 0.95);
        assert_eq!(own, (row[2] as usize, row[3] as usize), "{row:?}");
    }
}

/// The intervals contain the true percentile with the stated frequency.
#[test]
fn percentile_interval_has_stated_coverage() {
    let (runs, n, part) = (2000, 100, 0.9);
    let truth = normal_quantile(part);
    let axis = Coordinate::random(1, "cover");
    let mut held = 0;
    for run in 0..runs {
        let mut sample: Vec<f64> = (0..n).map(|k| normal_quantile(axis.at(run * n + k))).collect();
        sample.sort_by(f64::total_cmp);
        let own = percentile(&sample, part, 0.95).unwrap();
        held += u32::from(own.low.unwrap() <= truth && truth <= own.high.unwrap());
    }
    let share = f64::from(held) / runs as f64;
    assert!((0.95..0.985).contains(&share), "{share}");
    // too few values for an upper end: 58 values do not suffice for the 95 % percentile with 2.5 % on each side
    let few: Vec<f64> = (0..58).map(f64::from).collect();
    assert_eq!(percentile(&few, 0.95, 0.95).unwrap().high, None);
    assert_eq!(percentile(&[], 0.5, 0.95), None);
}

/// Ishigami and Homma's function, with indices known in closed form.
#[test]
fn sobol_indices_of_ishigami_function_match_closed_form() {
    let axes: Vec<[Coordinate; 2]> = (0..3)
        .map(|at| {
            let name = |which| format!("x{at} {which}");
            [0, 1].map(|which| Coordinate::sobol(1, &name(which), 2 * at + which).unwrap())
        })
        .collect();
    let f = |u: [f64; 3]| {
        let [a, b, c] = u.map(|u| std::f64::consts::PI * (2.0 * u - 1.0));
        a.sin() + 7.0 * b.sin().powi(2) + 0.1 * c.powi(4) * a.sin()
    };
    let rows: Vec<Vec<f64>> = (0..4096)
        .map(|k| {
            let from =
                |b: usize| -> [f64; 3] { std::array::from_fn(|at| axes[at][usize::from(b == 1 || b == at + 2)].at(k)) };
            (0..5).map(|block| f(from(block))).collect()
        })
        .collect();
    let own = indices(&rows).unwrap();
    let known = [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)];
    for (index, (first, total)) in own.iter().zip(known) {
        assert!((index.first - first).abs() < 0.02, "{own:?}");
        assert!((index.total - total).abs() < 0.02, "{own:?}");
        assert!(
            index.first_half_width > 0.0 && index.first_half_width < 0.1 && index.total_half_width < 0.1,
            "{own:?}"
        );
    }
    assert_eq!(indices(&vec![vec![1.0; 4]; 10]), None, "a constant has no parts");
}
