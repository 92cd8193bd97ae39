//! Robustness margins of the tuned gains: the uncertain loops for structured-singular-value analysis.

use super::linearise::{Robot, RobotError};
use super::plant::{Gains, actuation};
use super::spec::{ModelSpec, Spec};
use crate::interconnect::append;
use crate::linalg::{self, Matrix, diagonal};
use crate::mu::{Block, Margin, MarginOptions, MuError, Structure, margin};
use crate::state_space::StateSpace;

/// Errors of computing margins.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MarginError {
    /// An error of the robot or the specification.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// An error of the analysis.
    #[error(transparent)]
    Mu(#[from] MuError),
    /// Parametric errors are errors of the mass matrix; away from rest they would enter the Coriolis terms too.
    #[error("model {0}: parametric margins are defined for a linearisation at rest without slosh")]
    NotAtRest(String),
}

/// A margin with the set it refers to.
#[derive(Debug, Clone)]
pub struct StatedMargin {
    /// The uncertainty set, in words.
    pub set: String,
    /// The situation.
    pub model: String,
    /// The bounds.
    pub margin: Margin,
}

/// The closed velocity loop with an extra force input w and outputs of the caller's choice.
struct Loop {
    /// Inputs: n forces added to the actuators'. Outputs: accelerations (n_v), actuator forces (n).
    system: StateSpace,
    accelerations: usize,
}

fn close(spec: &Spec, robot: &Robot, model: &ModelSpec, gains: &Gains) -> Result<Loop, RobotError> {
    let body = robot.linearise(model)?;
    let (n, nv) = (body.channels, body.a.nrows());
    let act = actuation(spec, model, n, spec.sampling.pade_order_reporting)?;
    let kp = gains.proportional(&body.mass)?;
    let ni = gains.ki.len();
    let ki = diagonal(&gains.ki);
    let na = act.states();
    let measured = Matrix::from_fn(n, nv, |i, j| f64::from(u8::from(i == j)));
    // u = −K_P v + K_I x_i, ẋ_i = −v, f = C_a x_a + D_a u, v̇ = A v + B (f + w)
    let states = nv + na + ni;
    let mut u = Matrix::zeros(n, states);
    u.set_block(0, 0, &(&kp * &measured * -1.0));
    u.set_block(0, nv + na, &ki);
    let mut force = &act.d * &u;
    for i in 0..n {
        for j in 0..na {
            force[(i, nv + j)] += act.c[(i, j)];
        }
    }
    let mut a = Matrix::zeros(states, states);
    let mut acceleration = &body.b * &force;
    for i in 0..nv {
        for j in 0..nv {
            acceleration[(i, j)] += body.a[(i, j)];
        }
    }
    a.set_block(0, 0, &acceleration);
    let mut actuator = &act.b * &u;
    for i in 0..na {
        for j in 0..na {
            actuator[(i, nv + j)] += act.a[(i, j)];
        }
    }
    a.set_block(nv, 0, &actuator);
    if ni > 0 {
        a.set_block(nv + na, 0, &(&measured * -1.0));
    }
    let mut b = Matrix::zeros(states, n);
    b.set_block(0, 0, &body.b);
    let c = linalg::blocks(&[&[&acceleration], &[&force]]);
    let d = linalg::blocks(&[&[&body.b], &[&Matrix::zeros(n, n)]]);
    Ok(Loop {
        system: StateSpace { a, b, c, d },
        accelerations: nv,
    })
}

/// Multiplicative errors at every actuator, one complex number each: `f_i (1 + w(s) δ_i)` with |w| rising from the low to
/// the high value of the specification. Sizes are multiples of that.
///
/// # Errors
/// An unstable loop, impossible numbers.
pub fn multiplicative_loop(
    spec: &Spec,
    robot: &Robot,
    model: &ModelSpec,
    gains: &Gains,
) -> Result<(StateSpace, Structure), MarginError> {
    spec.check(robot.channels())?;
    let closed = close(spec, robot, model, gains)?;
    let n = robot.channels();
    let x = &spec.uncertainty;
    let (low, high, corner) = (
        x.multiplicative_low,
        x.multiplicative_high,
        x.multiplicative_cutoff_rad_s,
    );
    let one = StateSpace::transfer_function(&[high, corner * low], &[1.0, corner]).map_err(RobotError::from)?;
    let weights = append(&vec![one; n]);
    let forces = closed
        .system
        .select(closed.accelerations..closed.accelerations + n, 0..n);
    let system = crate::interconnect::series(&forces, &weights).unwrap_or(forces);
    Ok((system, Structure::new(vec![Block::Complex(1); n])?))
}

/// Real relative errors of base mass, base inertia and arm inertia, independent, each repeated as often as the rank of its
/// share of the mass matrix. Sizes are multiples of the specification's `parametric`.
///
/// # Errors
/// As above; a situation away from rest.
pub fn parametric_loop(
    spec: &Spec,
    robot: &Robot,
    model: &ModelSpec,
    gains: &Gains,
) -> Result<(StateSpace, Structure), MarginError> {
    if model.slosh || model.velocity.iter().any(|v| *v != 0.0) {
        return Err(MarginError::NotAtRest(model.name.clone()));
    }
    let closed = close(spec, robot, model, gains)?;
    let n = robot.channels();
    let mut factors = Vec::new();
    let mut blocks = Vec::new();
    for slope in robot.mass_slopes(model)? {
        // (M + Σ δ_k S_k) v̇ = f with S_k = E Eᵀ of low rank: w = −δ z, z = Eᵀ v̇, v̇ = M⁻¹ (f + E w).
        let (values, vectors) =
            linalg::symmetric_eigen(&(slope * spec.uncertainty.parametric)).map_err(RobotError::from)?;
        let largest = values.iter().fold(0.0f64, |x, v| x.max(v.abs()));
        let kept: Vec<usize> = (0..n).filter(|&i| values[i] > 1e-9 * largest).collect();
        factors.push(Matrix::from_fn(n, kept.len(), |i, j| {
            vectors[(i, kept[j])] * values[kept[j]].sqrt()
        }));
        blocks.push(Block::Real(kept.len()));
    }
    let e = linalg::blocks(&[&factors.iter().collect::<Vec<_>>()]);
    let acceleration = closed.system.select(0..n, 0..n);
    let system = StateSpace {
        a: acceleration.a.clone(),
        b: &acceleration.b * &e * -1.0,
        c: e.transpose() * &acceleration.c,
        d: e.transpose() * &acceleration.d * &e * -1.0,
    };
    Ok((system, Structure::new(blocks)?))
}

/// Both margins of one situation, the parametric one only at rest.
///
/// # Errors
/// As above.
pub fn margins(
    spec: &Spec,
    robot: &Robot,
    model: &ModelSpec,
    gains: &Gains,
    options: &MarginOptions,
) -> Result<Vec<StatedMargin>, MarginError> {
    let x = &spec.uncertainty;
    let mut out = Vec::new();
    let (system, structure) = multiplicative_loop(spec, robot, model, gains)?;
    out.push(StatedMargin {
        set: format!(
            "complex multiplicative error at each actuator, {} % rising to {} % beyond {} rad/s",
            100.0 * x.multiplicative_low,
            100.0 * x.multiplicative_high,
            x.multiplicative_cutoff_rad_s
        ),
        model: model.name.clone(),
        margin: margin(&system, &structure, options)?,
    });
    if !model.slosh && model.velocity.iter().all(|v| *v == 0.0) {
        let (system, structure) = parametric_loop(spec, robot, model, gains)?;
        out.push(StatedMargin {
            set: format!(
                "real, base mass, base inertia and arm inertia, each ±{} %, independent",
                100.0 * x.parametric
            ),
            model: model.name.clone(),
            margin: margin(&system, &structure, options)?,
        });
    }
    Ok(out)
}
