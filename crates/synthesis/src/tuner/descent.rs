//! BFGS with a weak Wolfe line search, as it is used on nonsmooth functions (Lewis and Overton 2013, HANSO).

use super::qp::{dot, length};

/// One evaluation: the value (may be infinite) and the gradient (empty when the value is only known to be too high).
pub(crate) type Evaluation<E> = Result<(f64, Vec<f64>), E>;

/// Termination criteria of a descent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Iterations.
    pub(crate) iterations: usize,
    /// End when `window` iterations together gained less than this.
    pub(crate) gain: f64,
    /// Length of that window.
    pub(crate) window: usize,
}

/// Minimises `f` from `x` (value `fx`, gradient `gx`). `f(x, ceiling)` may stop early above `ceiling`. `watch(x, value)` is
/// called after every accepted step and ends the descent by returning false. `metric` is the inverse Hessian of an earlier descent.
pub(crate) fn bfgs<E>(
    x: &mut Vec<f64>,
    fx: f64,
    gx: Vec<f64>,
    metric: Option<Metric>,
    limits: Limits,
    mut f: impl FnMut(&[f64], f64) -> Evaluation<E>,
    mut watch: impl FnMut(&[f64], f64) -> bool,
) -> Result<(f64, Metric), E> {
    let n = x.len();
    let (mut value, mut gradient) = (fx, gx);
    let mut first = metric.is_none();
    let mut inverse = metric.unwrap_or_else(|| identity(n, 1.0));
    let mut history = vec![value];
    for _ in 0..limits.iterations {
        let slope_scale = length(&gradient);
        if slope_scale == 0.0 || !slope_scale.is_finite() {
            break;
        }
        let mut direction: Vec<f64> = inverse.iter().map(|row| -dot(row, &gradient)).collect();
        if dot(&direction, &gradient) >= -1e-14 * slope_scale * length(&direction) {
            inverse = identity(n, 1.0 / slope_scale);
            direction = gradient.iter().map(|g| -g / slope_scale).collect();
        }
        // The first step has no scale of its own: never longer than one unit of the parameters.
        let start = if first {
            (1.0 / length(&direction)).min(1.0)
        } else {
            1.0
        };
        let Some(step) = weak_wolfe(x, value, &gradient, &direction, start, &mut f)? else {
            break;
        };
        let s: Vec<f64> = step.x.iter().zip(x.iter()).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = step.gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
        let sy = dot(&s, &y);
        if sy > 1e-14 * length(&s) * length(&y) {
            if first {
                inverse = identity(n, sy / dot(&y, &y));
            }
            update(&mut inverse, &s, &y, sy);
        }
        first = false;
        *x = step.x;
        value = step.value;
        gradient = step.gradient;
        if !watch(x, value) {
            break;
        }
        history.push(value);
        let k = history.len();
        if k > limits.window && history[k - 1 - limits.window] - value < limits.gain {
            break;
        }
    }
    Ok((value, inverse))
}

/// The inverse Hessian approximation of a descent.
pub(crate) type Metric = Vec<Vec<f64>>;

pub(crate) fn identity(n: usize, scale: f64) -> Vec<Vec<f64>> {
    (0..n)
        .map(|i| (0..n).map(|j| if i == j { scale } else { 0.0 }).collect())
        .collect()
}

/// The BFGS update of the inverse Hessian.
fn update(h: &mut [Vec<f64>], s: &[f64], y: &[f64], sy: f64) {
    let hy: Vec<f64> = h.iter().map(|row| dot(row, y)).collect();
    let factor = (1.0 + dot(y, &hy) / sy) / sy;
    for i in 0..s.len() {
        for j in 0..s.len() {
            h[i][j] += factor * s[i] * s[j] - (hy[i] * s[j] + s[i] * hy[j]) / sy;
        }
    }
}

struct Step {
    x: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// A step with sufficient decrease after which the slope has risen, by bisection and doubling. It exists also where the
/// function has a kink along the line; the last point with sufficient decrease is the fallback.
fn weak_wolfe<E>(
    x: &[f64],
    value: f64,
    gradient: &[f64],
    direction: &[f64],
    start: f64,
    f: &mut impl FnMut(&[f64], f64) -> Evaluation<E>,
) -> Result<Option<Step>, E> {
    const DECREASE: f64 = 1e-4;
    const SLOPE: f64 = 0.5;
    let slope = dot(gradient, direction);
    let (mut low, mut high, mut t) = (0.0, f64::INFINITY, start);
    let mut best: Option<Step> = None;
    for _ in 0..45 {
        let trial: Vec<f64> = x.iter().zip(direction).map(|(a, d)| a + t * d).collect();
        let ceiling = value + DECREASE * t * slope;
        let (trial_value, trial_gradient) = f(&trial, ceiling)?;
        if trial_value.is_nan() || trial_value > ceiling || trial_gradient.is_empty() {
            high = t;
        } else {
            let rising = dot(&trial_gradient, direction) >= SLOPE * slope;
            if best.as_ref().is_none_or(|b| trial_value < b.value) {
                best = Some(Step {
                    x: trial,
                    value: trial_value,
                    gradient: trial_gradient,
                });
            }
            if rising {
                return Ok(best);
            }
            low = t;
        }
        t = if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * low
        };
        if high.is_finite() && high - low <= 1e-13 * high {
            break;
        }
        if t * length(direction) < 1e-14 * (1.0 + length(x)) || t > 1e12 {
            break;
        }
    }
    Ok(best)
}
