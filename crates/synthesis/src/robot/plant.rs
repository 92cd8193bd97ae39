//! The generalised plant of the velocity loop, and the tuning problem built from it.
//!
//! ```text
//!            d̂ ─ D ─────┐
//!  r̂ ─ V ─(+)─ e ─┬─ K_P + K_I/s ─ u ─ delay, lag ─(+)─ M⁻¹/s ─ v ─┬─ W_L V⁻¹ ─ z₃
//!          −│     └─ W_S V⁻¹ ─ z₁      │                            │
//!           │                          └─ W_u F⁻¹ ─ z₂              │
//!           └───────────────────────────────────────────────────────┘
//! ```
//!
//! r̂ represents both a change of the reference and measurement noise: both enter the error. V, F and D are the sizes of
//! velocity, force and disturbance. Channel "tracking" leads from r̂ to (z₁, z₂), channel "load" from d̂ to z₃.

use super::linearise::{Body, Robot, RobotError};
use super::spec::{GainStructure, LoadSpec, ModelSpec, Spec};
use crate::delay::pade;
use crate::interconnect::{append, series};
use crate::linalg::{self, Matrix, diagonal};
use crate::state_space::StateSpace;
use crate::tuner::{Channel, GainBlock, GainKind, Model, Problem};

/// The gains of the law: u = K_P e + K_I ∫e.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// Structure of `kp`.
    pub structure: GainStructure,
    /// K_P, n × n; for the scheduled structure X, from which K_P(q) = M(q)^½ X M(q)^½.
    pub kp: Matrix,
    /// The diagonal of K_I; empty for a proportional law.
    pub ki: Vec<f64>,
}

impl Gains {
    /// K_P for a mass matrix.
    ///
    /// # Errors
    /// A mass matrix that is not positive definite.
    pub fn proportional(&self, mass: &Matrix) -> Result<Matrix, RobotError> {
        if self.structure != GainStructure::Scheduled {
            return Ok(self.kp.clone());
        }
        let root = linalg::sqrt_spd(mass)?;
        Ok(&root * &self.kp * &root)
    }
}

/// The delay and lag between command and force, n × n.
pub(super) fn actuation(spec: &Spec, model: &ModelSpec, n: usize, order: usize) -> Result<StateSpace, RobotError> {
    let delay = pade(spec.sampling.total_delay_s() + model.extra_delay_s, order)?;
    let lag = spec.sampling.actuator_lag_s;
    let one = if lag > 0.0 {
        let lag = StateSpace::transfer_function(&[1.0], &[lag, 1.0])?;
        series(&delay, &lag).unwrap_or(delay)
    } else {
        delay
    };
    Ok(append(&vec![one; n]))
}

fn bank(n: usize, make: impl Fn(usize) -> Result<StateSpace, RobotError>) -> Result<StateSpace, RobotError> {
    Ok(append(&(0..n).map(make).collect::<Result<Vec<_>, _>>()?))
}

/// The tracking weights W_S, one per channel.
///
/// # Errors
/// An improper weight.
pub fn tracking_weights(spec: &Spec) -> Result<StateSpace, RobotError> {
    let w = &spec.weights;
    bank(w.cutoff_rad_s.len(), |i| {
        let omega = w.cutoff_rad_s[i];
        Ok(StateSpace::transfer_function(
            &[1.0 / w.peak, omega],
            &[1.0, omega * w.floor],
        )?)
    })
}

/// The load weights W_L, one per channel.
fn load_weights(spec: &Spec, load: &LoadSpec, n: usize) -> Result<StateSpace, RobotError> {
    bank(n, |i| {
        let omega = load.ratio * spec.weights.cutoff_rad_s[i];
        Ok(StateSpace::transfer_function(
            &[1.0, omega],
            &[1.0, omega * load.floor],
        )?)
    })
}

/// The generalised plant of one situation: inputs [r̂; d̂; u], outputs [z₁; z₂; z₃ (with a load weight); e; ∫e (with an
/// integral part)].
///
/// # Errors
/// A situation or a number that is impossible.
pub fn generalised_plant(spec: &Spec, body: &Body, model: &ModelSpec, order: usize) -> Result<StateSpace, RobotError> {
    let n = body.channels;
    let nv = body.a.nrows();
    let inverse = |x: &[f64]| x.iter().map(|v| 1.0 / v).collect::<Vec<_>>();
    let sizes = if model.error_sizes.is_empty() {
        &spec.scales.velocity
    } else {
        &model.error_sizes
    };
    let (v, v_inv) = (diagonal(sizes), inverse(sizes));
    let d = diagonal(&spec.scales.disturbance);
    let act = actuation(spec, model, n, order)?;
    let ones = vec![1.0; n];
    let ws = tracking_weights(spec)?.scaled(&ones, &v_inv);
    let wl = match &spec.weights.load {
        Some(load) => load_weights(spec, load, n)?.scaled(&ones, &v_inv),
        None => StateSpace {
            a: Matrix::zeros(0, 0),
            b: Matrix::zeros(0, n),
            c: Matrix::zeros(0, 0),
            d: Matrix::zeros(0, n),
        },
    };
    let ni = if spec.gains.integral { n } else { 0 };
    let (na, ns, nl) = (act.states(), ws.states(), wl.states());
    let nz3 = wl.outputs();
    // State offsets.
    let (xv, xa) = (0, nv);
    let xi = xa + na;
    let xs = xi + ni;
    let xl = xs + ns;
    let states = xl + nl;
    let (rows, columns) = (2 * n + nz3 + n + ni, 3 * n);
    let mut p = StateSpace {
        a: Matrix::zeros(states, states),
        b: Matrix::zeros(states, columns),
        c: Matrix::zeros(rows, states),
        d: Matrix::zeros(rows, columns),
    };
    let (r, dist, u) = (0, n, 2 * n);
    let (z2, z3, e) = (n, 2 * n, 2 * n + nz3);
    let neg = |m: &Matrix| m * -1.0;
    // v̇ = A v + B (f + D d̂), f = C_a x_a + D_a u
    p.a.set_block(xv, xv, &body.a);
    p.a.set_block(xv, xa, &(&body.b * &act.c));
    p.b.set_block(xv, u, &(&body.b * &act.d));
    p.b.set_block(xv, dist, &(&body.b * &d));
    p.a.set_block(xa, xa, &act.a);
    p.b.set_block(xa, u, &act.b);
    // e = V r̂ − v
    let measured = Matrix::from_fn(n, nv, |i, j| f64::from(u8::from(i == j)));
    let minus_measured = neg(&measured);
    p.c.set_block(e, xv, &minus_measured);
    p.d.set_block(e, r, &v);
    if ni > 0 {
        p.a.set_block(xi, xv, &minus_measured);
        p.b.set_block(xi, r, &v);
        p.c.set_block(e + n, xi, &Matrix::identity(n, n));
    }
    // z₁ = W_S V⁻¹ e
    p.a.set_block(xs, xs, &ws.a);
    p.a.set_block(xs, xv, &neg(&(&ws.b * &measured)));
    p.b.set_block(xs, r, &(&ws.b * &v));
    p.c.set_block(0, xs, &ws.c);
    p.c.set_block(0, xv, &neg(&(&ws.d * &measured)));
    p.d.set_block(0, r, &(&ws.d * &v));
    // z₂ = W_u F⁻¹ u
    let effort: Vec<f64> = spec.scales.authority.iter().map(|f| spec.weights.effort / f).collect();
    p.d.set_block(z2, u, &diagonal(&effort));
    // z₃ = W_L V⁻¹ v
    if nl > 0 {
        p.a.set_block(xl, xl, &wl.a);
        p.a.set_block(xl, xv, &(&wl.b * &measured));
        p.c.set_block(z3, xl, &wl.c);
        p.c.set_block(z3, xv, &(&wl.d * &measured));
    }
    Ok(p)
}

/// The tuning problem of a specification; `extra` are models beyond those of the specification (an adversary's), `gains`
/// replaces the start values.
///
/// # Errors
/// A specification that does not fit the robot.
pub fn problem(
    spec: &Spec,
    robot: &Robot,
    extra: &[ModelSpec],
    order: usize,
    gains: Option<&Gains>,
) -> Result<Problem, RobotError> {
    let n = robot.channels();
    spec.check(n)?;
    let g = &spec.gains;
    let kind = match g.structure {
        GainStructure::Diagonal => GainKind::PositiveDiagonal(n),
        GainStructure::Block => GainKind::PositiveDefinite(vec![3, 3, n - 6]),
        GainStructure::Full | GainStructure::Scheduled => GainKind::PositiveDefinite(vec![n]),
    };
    let start = gains.map_or_else(|| diagonal(&g.start_kp), |x| x.kp.clone());
    let mut blocks = vec![GainBlock {
        name: "K_P".into(),
        kind,
        row: 0,
        column: 0,
        start,
        unit: 1.0,
    }];
    if g.integral {
        let start = diagonal(gains.map_or(&g.start_ki, |x| &x.ki));
        let kind = GainKind::PositiveDiagonal(n);
        blocks.push(GainBlock {
            name: "K_I".into(),
            kind,
            row: 0,
            column: n,
            start,
            unit: 1.0,
        });
    }
    let mut models = Vec::new();
    for model in spec.models.iter().chain(extra) {
        let body = robot.linearise(model)?;
        let plant = generalised_plant(spec, &body, model, order)?;
        let measurements = if g.integral { 2 * n } else { n };
        let mut channels = vec![Channel {
            name: "tracking".into(),
            outputs: 0..2 * n,
            inputs: 0..n,
        }];
        if spec.weights.load.is_some() {
            channels.push(Channel {
                name: "load".into(),
                outputs: 2 * n..3 * n,
                inputs: n..2 * n,
            });
        }
        let scheduled = if g.structure == GainStructure::Scheduled {
            let root = linalg::sqrt_spd(&body.mass)?;
            Some((root.clone(), root))
        } else {
            None
        };
        let mut transforms = vec![scheduled];
        if g.integral {
            transforms.push(None);
        }
        models.push(Model {
            name: model.name.clone(),
            plant,
            controls: n,
            measurements,
            channels,
            transforms,
        });
    }
    Ok(Problem { models, gains: blocks })
}
