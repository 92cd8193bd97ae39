//! The tree in one situation: mass matrix, linearised velocity dynamics, and the mass matrix's dependence on uncertain parameters.

use multibody::{Description, DynState, DynTree, Quaternion};

use super::spec::{ModelSpec, RobotSpec};
use crate::linalg::{self, LinalgError, Matrix};

/// Errors of linearising a robot or forming its problem.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RobotError {
    /// The description is invalid.
    #[error("the robot description: {0}")]
    Description(String),
    /// A list of the specification has the wrong length.
    #[error("{what} has {found} entries, the robot has {expected} channels")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        expected: usize,
    },
    /// A number of the specification is invalid.
    #[error("{what} = {value}: {reason}")]
    Value {
        /// Name of the number.
        what: String,
        /// Its value.
        value: f64,
        /// The reason.
        reason: &'static str,
    },
    /// A situation at an instant of a run that has not been looked up.
    #[error("models: `{model}` has no joints_deg, and its `at = {at:?}` has not been looked up")]
    NotLookedUp {
        /// The situation.
        model: String,
        /// The run and the instant.
        at: String,
    },
    /// A delay is negative, or an approximant's order is out of range.
    #[error(transparent)]
    Delay(#[from] crate::delay::DelayError),
    /// A weight has no state-space form.
    #[error(transparent)]
    Model(#[from] crate::state_space::ModelError),
    /// The mass matrix or another matrix is degenerate.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// The linearised tree. The first `channels` velocities are measured and actuated; others (slosh) are free.
#[derive(Debug, Clone)]
pub struct Body {
    /// Number of actuated channels: 6 + joints.
    pub channels: usize,
    /// Mass matrix of the actuated channels in the controller's model for this situation (propellant as a rigid mass), n × n.
    pub mass: Matrix,
    /// Velocity dynamics `v̇ = a v + b f`, n_v × n_v.
    pub a: Matrix,
    /// n_v × n: acceleration per actuated force.
    pub b: Matrix,
}

/// Builds bodies from one robot description.
#[derive(Debug, Clone)]
pub struct Robot {
    pub(super) description: Description,
    pub(super) spec: RobotSpec,
    joints: usize,
}

impl Robot {
    /// A robot from the text of its URDF file and the spec.
    ///
    /// # Errors
    /// A description that cannot be read, unknown names.
    pub fn new(urdf: &str, spec: &RobotSpec) -> Result<Self, RobotError> {
        let description = Description::from_urdf(urdf).map_err(|e| RobotError::Description(e.to_string()))?;
        Self::from_description(description, spec)
    }

    /// A robot from a description; the rotor inertias of the spec are added to the description's.
    ///
    /// # Errors
    /// Unknown names.
    pub fn from_description(mut description: Description, spec: &RobotSpec) -> Result<Self, RobotError> {
        let refused = |e: &dyn std::fmt::Display| RobotError::Description(e.to_string());
        let actuated: Vec<String> = description
            .moving_joints()
            .map(|j| j.name.clone())
            .filter(|n| !spec.frozen.contains_key(n))
            .collect();
        for joint in &actuated {
            description
                .add_motor_inertia(joint, spec.motor_inertia_kg_m2)
                .map_err(|e| refused(&e))?;
        }
        let robot = Self {
            description,
            spec: spec.clone(),
            joints: actuated.len(),
        };
        // Report unknown link and joint names now, not in the middle of a search.
        robot.tree(&ModelSpec::nominal(vec![0.0; robot.joints]), true)?;
        Ok(robot)
    }

    /// Number of actuated channels: six of the base and the joints.
    pub fn channels(&self) -> usize {
        6 + self.joints
    }

    fn tree(&self, model: &ModelSpec, frozen: bool) -> Result<DynTree, RobotError> {
        let refused = |e: &dyn std::fmt::Display| RobotError::Description(e.to_string());
        let mut d = self.description.clone();
        let base = &self.spec.base_link;
        // `scale_mass` also scales the inertia; the second factor corrects it to the requested one.
        d.scale_mass(base, model.base_mass).map_err(|e| refused(&e))?;
        d.scale_inertia(base, model.base_inertia / model.base_mass)
            .map_err(|e| refused(&e))?;
        for link in &self.spec.arm_links {
            d.scale_mass(link, model.arm_inertia).map_err(|e| refused(&e))?;
        }
        for link in &self.spec.propellant_links {
            d.scale_mass(link, model.fill).map_err(|e| refused(&e))?;
        }
        if frozen {
            for (joint, at) in &self.spec.frozen {
                d.freeze(joint, *at).map_err(|e| refused(&e))?;
            }
        }
        DynTree::new(&d, true).map_err(|e| refused(&e))
    }

    /// The mass matrix of one tree with the payload's contribution, at this configuration.
    fn mass(&self, tree: &DynTree, state: &DynState, model: &ModelSpec) -> Result<Matrix, RobotError> {
        let (m, _) = tree.mass_and_coriolis(state);
        let mut mass = Matrix::from_fn(m.rows, m.cols, |i, j| m[(i, j)]);
        if let Some(p) = &model.payload {
            let frame = tree
                .frame(&self.spec.end_effector)
                .map_err(|e| RobotError::Description(e.to_string()))?;
            let (j, _) = tree.jacobian_and_rate(state, frame);
            let jacobian = Matrix::from_fn(6, m.cols, |r, c| j[(r, c)]);
            mass += jacobian.transpose() * spatial_inertia(p) * &jacobian;
        }
        Ok(linalg::symmetric_part(&mass))
    }

    /// The linearised tree in one situation.
    ///
    /// # Errors
    /// Wrong number of joint angles, an impossible factor, a payload at a nonzero velocity.
    pub fn linearise(&self, model: &ModelSpec) -> Result<Body, RobotError> {
        self.check(model)?;
        let n = self.channels();
        let frozen_tree = self.tree(model, true)?;
        let mass = self.mass(&frozen_tree, &self.state(&frozen_tree, model)?, model)?;
        let tree = if model.slosh {
            self.tree(model, false)?
        } else {
            frozen_tree
        };
        let state = self.state(&tree, model)?;
        let full = self.mass(&tree, &state, model)?;
        let nv = tree.dim();
        let inverse = linalg::inverse(&full)?;
        // −∂(C ν + D ν)/∂ν. The bias is quadratic in ν, so a central difference of any step is exact up to rounding.
        let mut slope = Matrix::zeros(nv, nv);
        if state.nu.iter().any(|x| *x != 0.0) {
            let step = 0.5;
            for k in 0..nv {
                let mut perturbed = state.clone();
                perturbed.nu[k] = state.nu[k] + step;
                let up = tree.bias(&perturbed);
                perturbed.nu[k] = state.nu[k] - step;
                let down = tree.bias(&perturbed);
                for i in 0..nv {
                    slope[(i, k)] = -(up[i] - down[i]) / (2.0 * step);
                }
            }
        }
        for body in tree.bodies() {
            if let Some(c) = body.coordinate {
                slope[(6 + c, 6 + c)] -= body.damping;
            }
        }
        // The actuated joints come first if the slosh joints are declared last in the description; otherwise the order of the
        // joints differs, so select by name.
        let order = self.order(&tree);
        let reorder = |m: &Matrix| Matrix::from_fn(nv, nv, |i, j| m[(order[i], order[j])]);
        let a = reorder(&(&inverse * &slope));
        let b = reorder(&inverse).block(0, 0, nv, n);
        Ok(Body {
            channels: n,
            mass,
            a,
            b,
        })
    }

    /// Velocity coordinates with the actuated ones first.
    fn order(&self, tree: &DynTree) -> Vec<usize> {
        let mut actuated: Vec<usize> = (0..6).collect();
        let mut free = Vec::new();
        let mut joints: Vec<(usize, bool)> = tree
            .bodies()
            .iter()
            .filter_map(|b| Some((b.coordinate?, self.spec.frozen.contains_key(b.joint.as_ref()?))))
            .collect();
        joints.sort_unstable();
        for (c, is_free) in joints {
            if is_free {
                free.push(6 + c)
            } else {
                actuated.push(6 + c)
            }
        }
        actuated.extend(free);
        actuated
    }

    fn state(&self, tree: &DynTree, model: &ModelSpec) -> Result<DynState, RobotError> {
        let order = self.order(tree);
        let mut q = vec![0.0; tree.joints()];
        for (k, angle) in model.joints_deg.iter().enumerate() {
            q[order[6 + k] - 6] = angle.to_radians();
        }
        for body in tree.bodies() {
            if let (Some(c), Some(joint)) = (body.coordinate, &body.joint)
                && let Some(at) = self.spec.frozen.get(joint)
            {
                q[c] = *at;
            }
        }
        let mut nu = vec![0.0; tree.dim()];
        for (k, v) in model.velocity.iter().enumerate() {
            nu[order[k]] = *v;
        }
        Ok(DynState {
            p_nb: Default::default(),
            quat_nb: Quaternion::from_wxyz([1.0, 0.0, 0.0, 0.0]),
            q,
            nu,
        })
    }

    fn check(&self, model: &ModelSpec) -> Result<(), RobotError> {
        if let (true, Some(at)) = (model.joints_deg.is_empty(), &model.at) {
            return Err(RobotError::NotLookedUp {
                model: model.name.clone(),
                at: at.clone(),
            });
        }
        if model.joints_deg.len() != self.joints {
            return Err(RobotError::Length {
                what: "joints_deg",
                found: model.joints_deg.len(),
                expected: self.joints,
            });
        }
        if !model.velocity.is_empty() && model.velocity.len() != self.channels() {
            return Err(RobotError::Length {
                what: "velocity",
                found: model.velocity.len(),
                expected: self.channels(),
            });
        }
        if !model.error_sizes.is_empty() && model.error_sizes.len() != self.channels() {
            return Err(RobotError::Length {
                what: "error_sizes",
                found: model.error_sizes.len(),
                expected: self.channels(),
            });
        }
        if let Some(&value) = model.error_sizes.iter().find(|x| !(x.is_finite() && **x > 0.0)) {
            return Err(RobotError::Value {
                what: "error_sizes".into(),
                value,
                reason: "must be positive",
            });
        }
        for (what, value) in [
            ("base_mass", model.base_mass),
            ("base_inertia", model.base_inertia),
            ("arm_inertia", model.arm_inertia),
        ] {
            if value.is_nan() || value <= 0.0 {
                return Err(RobotError::Value {
                    what: what.into(),
                    value,
                    reason: "a factor on a mass must be positive",
                });
            }
        }
        if model.payload.is_some() && model.velocity.iter().any(|v| *v != 0.0) {
            let reason = "a payload is supported at rest only (its Coriolis forces are not modelled)";
            return Err(RobotError::Value {
                what: "velocity".into(),
                value: model.velocity[0],
                reason,
            });
        }
        Ok(())
    }

    /// The change of the controller's mass matrix per unit of each relative parametric error: base mass, base inertia, arm
    /// inertia. The mass matrix is linear in all three.
    ///
    /// # Errors
    /// As [`Self::linearise`].
    pub fn mass_slopes(&self, model: &ModelSpec) -> Result<[Matrix; 3], RobotError> {
        let at = |m: &ModelSpec| -> Result<Matrix, RobotError> {
            let tree = self.tree(m, true)?;
            self.mass(&tree, &self.state(&tree, m)?, m)
        };
        let nominal = at(model)?;
        let mut out = [nominal.clone(), nominal.clone(), nominal.clone()];
        for (k, slope) in out.iter_mut().enumerate() {
            let mut perturbed = model.clone();
            match k {
                0 => perturbed.base_mass += 1.0,
                1 => perturbed.base_inertia += 1.0,
                _ => perturbed.arm_inertia += 1.0,
            }
            *slope = at(&perturbed)? - &nominal;
        }
        Ok(out)
    }
}

impl ModelSpec {
    /// The nominal situation at these joint angles (deg).
    pub fn nominal(joints_deg: Vec<f64>) -> Self {
        Self {
            name: "nominal".into(),
            joints_deg,
            at: None,
            base_mass: 1.0,
            base_inertia: 1.0,
            arm_inertia: 1.0,
            fill: 1.0,
            extra_delay_s: 0.0,
            payload: None,
            error_sizes: Vec::new(),
            slosh: false,
            velocity: Vec::new(),
        }
    }
}

/// Spatial inertia about the frame's origin, order [rotation; translation].
fn spatial_inertia(p: &super::spec::Payload) -> Matrix {
    let (m, [x, y, z]) = (p.mass_kg, p.com_m);
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    Matrix::from_fn(6, 6, |i, j| match (i < 3, j < 3) {
        (true, true) => {
            let own = if i == j { p.inertia_kg_m2[i] } else { 0.0 };
            own - m * (0..3).map(|k| skew[i][k] * skew[k][j]).sum::<f64>()
        }
        (true, false) => m * skew[i][j - 3],
        (false, true) => -m * skew[i - 3][j],
        (false, false) => {
            if i == j {
                m
            } else {
                0.0
            }
        }
    })
}
