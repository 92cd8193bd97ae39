//! Plots of gains over frequency.

use report::figures::{Chart, Curve, Stroke, svg};
use synthesis::interconnect::lft_lower;
use synthesis::linalg::{from_rows, singular_values, to_rows};
use synthesis::mu::{MarginOptions, margin, upper_bound};
use synthesis::norm::gain_at;
use synthesis::robot::{Gains, Robot, Spec, multiplicative_loop, tracking_weights};
use synthesis::state_space::StateSpace;
use synthesis::tuner::Problem;

/// Plots of the first model as names and texts of SVG files: singular values of the channels, sensitivity against its weight, mu bounds.
///
/// # Errors
/// A frequency at which a system cannot be evaluated.
pub fn plots(
    spec: &Spec,
    robot: &Robot,
    problem: &Problem,
    gains: &Gains,
    with_mu: bool,
) -> anyhow::Result<Vec<(String, String)>> {
    let closed = closed_loop(spec, robot, problem, gains)?;
    let mut all = vec![
        (
            "channels.svg".to_string(),
            render_svg(
                "Weighted channels: largest singular value",
                "gain",
                channels(problem, &closed)?,
            ),
        ),
        (
            "sensitivity.svg".to_string(),
            render_svg(
                "Sensitivity against its bounds",
                "|S|",
                sensitivity(spec, robot, &closed)?,
            ),
        ),
    ];
    if with_mu {
        all.push((
            "mu.svg".to_string(),
            render_svg(
                "mu for multiplicative errors at the actuators",
                "mu",
                mu(spec, robot, gains)?,
            ),
        ));
    }
    Ok(all)
}

/// Curves over frequency as SVG, both axes logarithmic.
fn render_svg(title: &str, y_label: &str, mut curves: Vec<Curve>) -> String {
    let usable = |[x, y]: &[f64; 2]| *x > 0.0 && x.is_finite() && *y > 0.0 && y.is_finite();
    for curve in &mut curves {
        curve.points.retain(usable);
    }
    // Curves that decay to zero would flatten all others.
    let points = || curves.iter().flat_map(|curve| &curve.points);
    let greatest = points().map(|[_, y]| *y).fold(0.0, f64::max);
    let least = 10f64.powf(greatest.log10().ceil() - 6.0);
    for [_, y] in curves.iter_mut().flat_map(|curve| &mut curve.points) {
        *y = y.max(least);
    }
    let chart = Chart {
        title: title.to_owned(),
        x_label: "frequency, rad/s".to_owned(),
        y_label: y_label.to_owned(),
        logarithmic_x: true,
        logarithmic: true,
        curves,
        ..Chart::default()
    };
    svg(&chart.drawing())
}

/// The generalised plant of the first model with its controller.
fn closed_loop(spec: &Spec, robot: &Robot, problem: &Problem, gains: &Gains) -> anyhow::Result<StateSpace> {
    let mass = robot.linearise(&spec.models[0])?.mass;
    let kp = to_rows(&gains.proportional(&mass)?);
    let rows: Vec<Vec<f64>> = (0..robot.channels())
        .map(|i| {
            let mut row = kp[i].clone();
            row.extend((0..gains.ki.len()).map(|j| if i == j { gains.ki[i] } else { 0.0 }));
            row
        })
        .collect();
    let controller = StateSpace::gain(from_rows(&rows)?);
    Ok(lft_lower(&problem.models[0].plant, &controller)?)
}

/// A curve over six decades of frequency.
fn curve(name: &str, stroke: Stroke, f: &dyn Fn(f64) -> anyhow::Result<f64>) -> anyhow::Result<Curve> {
    let grid = (0..160).map(|i| 10f64.powf(-3.0 + 6.0 * f64::from(i) / 159.0));
    Ok(Curve {
        name: name.into(),
        points: grid.map(|w| Ok([w, f(w)?])).collect::<anyhow::Result<Vec<_>>>()?,
        stroke,
    })
}

/// The largest singular value of each channel.
fn channels(problem: &Problem, closed: &StateSpace) -> anyhow::Result<Vec<Curve>> {
    let mut curves = Vec::new();
    for c in &problem.models[0].channels {
        let part = closed.select(c.outputs.clone(), c.inputs.clone());
        curves.push(curve(&c.name, Stroke::Plain, &|w| Ok(gain_at(&part, w)?))?);
    }
    curves.push(curve("one: weights met", Stroke::Dashed, &|_| Ok(1.0))?);
    Ok(curves)
}

/// The sensitivity of one channel of each kind, with its bound.
fn sensitivity(spec: &Spec, robot: &Robot, closed: &StateSpace) -> anyhow::Result<Vec<Curve>> {
    let n = robot.channels();
    // z₁ is the weighted sensitivity: undoing the weight per channel gives the sensitivity in units of the error sizes.
    let weighted = closed.select(0..n, 0..n);
    let weights = tracking_weights(spec)?;
    let mut curves = Vec::new();
    for (i, name) in [(0, "rotation x"), (3, "translation x"), (6, "first joint")] {
        let own = weighted.select(i..i + 1, i..i + 1);
        let weight = weights.select(i..i + 1, i..i + 1);
        curves.push(curve(name, Stroke::Plain, &|w| {
            Ok(gain_at(&own, w)? / gain_at(&weight, w)?)
        })?);
        curves.push(curve(&format!("{name}: bound"), Stroke::Dashed, &|w| {
            Ok(1.0 / gain_at(&weight, w)?)
        })?);
    }
    Ok(curves)
}

/// Mu of the multiplicative errors: both bounds, the largest singular value, and the bound that holds for all frequencies.
fn mu(spec: &Spec, robot: &Robot, gains: &Gains) -> anyhow::Result<Vec<Curve>> {
    let (system, structure) = multiplicative_loop(spec, robot, &spec.models[0], gains)?;
    let found = margin(&system, &structure, &MarginOptions::default())?;
    let upper = found
        .curve
        .iter()
        .filter(|p| p.0.is_finite())
        .map(|p| [p.0, p.1])
        .collect();
    let unstructured = curve("largest singular value", Stroke::Dashed, &|w| {
        Ok(singular_values(&system.at(w))?[0])
    })?;
    let guaranteed = curve("guaranteed for all frequencies", Stroke::Dashed, &|_| {
        Ok(1.0 / found.guaranteed)
    })?;
    let mut curves = vec![
        Curve {
            name: "mu, upper bound".into(),
            points: upper,
            stroke: Stroke::Plain,
        },
        unstructured,
        guaranteed,
    ];
    if let Some(p) = &found.perturbation {
        let at = upper_bound(&system.at(p.omega), &structure, 1e-4)?.value;
        let points = vec![[p.omega, 1.0 / p.size], [p.omega, at.max(1.0 / p.size)]];
        curves.push(Curve {
            name: "mu, lower bound (perturbation found)".into(),
            points,
            stroke: Stroke::Plain,
        });
    }
    Ok(curves)
}
