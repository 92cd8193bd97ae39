//! The outer loop: from pose errors of the end effector to a virtual velocity of all 13 degrees of freedom (Eq 10 to 17).

mod attitude;
mod pseudoinverse;
mod weights;

pub use attitude::{AttitudeError, AttitudeLaw, AttitudeState};
pub use pseudoinverse::WeightedPseudoinverse;
pub use weights::{ArmWeight, Weight, Weights};

use crate::{Dof, JOINTS, Jacobian, ParameterError, Twist};
use guidance_laws::{Pose, SetPoint};
use nalgebra::Vector3;

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OuterParameters {
    /// Definition of the attitude error.
    pub attitude: AttitudeLaw,
    /// Diagonal of `K_att`, 1/s. Slightly unequal gains avoid a symmetry in which the error could be trapped.
    pub attitude_gain: Vector3<f64>,
    /// Diagonal of `K_pos`, 1/s.
    pub position_gain: Vector3<f64>,
    /// Weights that share the motion between base and arm.
    pub weights: Weights,
}

impl Default for OuterParameters {
    /// The hybrid law with the paper's gains and weights.
    fn default() -> Self {
        Self {
            attitude: AttitudeLaw::default(),
            attitude_gain: Vector3::new(1.0, 0.99, 1.01),
            position_gain: Vector3::repeat(1.0),
            weights: Weights::default(),
        }
    }
}

/// Inputs of the outer loop.
#[derive(Debug, Clone, Copy)]
pub struct OuterInput<'a> {
    /// Pose of the end effector in the world.
    pub end_effector: &'a Pose,
    /// Distance of the base from the target's centre of mass, m.
    pub base_distance_m: f64,
    /// Body Jacobian `J_v`.
    pub jacobian: &'a Jacobian,
    /// Further factor on the weight of each joint, 1 for none.
    pub joint_factor: &'a [f64; JOINTS],
    /// Set-point; `None` commands the end effector to hold its pose.
    pub set_point: Option<&'a SetPoint>,
}

/// Outputs of the outer loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OuterOutput {
    /// Virtual velocity `ṽ_v`: order and units of the generalised velocity.
    pub velocity: Dof,
    /// Commanded twist of the end effector, `[w; v]` in end-effector axes, rad/s and m/s.
    pub twist: Twist,
    /// Position error `p_e = p_E − p_d`, world axes, m.
    pub position_error: Vector3<f64>,
    /// Attitude error.
    pub attitude_error: AttitudeError,
    /// Weight of the arm.
    pub weight: Weight,
    /// The current pseudoinverse, for motions in its null space.
    pub inverse: WeightedPseudoinverse,
}

/// The outer loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OuterLoop {
    parameters: OuterParameters,
    attitude: AttitudeState,
}

impl OuterLoop {
    /// An outer loop in its initial state.
    ///
    /// # Errors
    ///
    /// Names the gain or weight that is out of range.
    pub fn new(parameters: OuterParameters) -> Result<Self, ParameterError> {
        for gain in parameters.attitude_gain.iter() {
            ParameterError::positive("outer.attitude_gain", *gain)?;
        }
        for gain in parameters.position_gain.iter() {
            ParameterError::positive("outer.position_gain", *gain)?;
        }
        parameters.attitude.validate()?;
        parameters.weights.validate()?;
        Ok(Self {
            parameters,
            attitude: AttitudeState::START,
        })
    }

    /// Complete state of the outer loop.
    pub fn state(&self) -> &AttitudeState {
        &self.attitude
    }

    /// Continues from `state`, bit for bit.
    pub fn restore(&mut self, state: &AttitudeState) {
        self.attitude = *state;
    }

    /// The virtual velocity at this instant.
    pub fn step(&mut self, input: &OuterInput) -> OuterOutput {
        let weight = self.parameters.weights.at(input.base_distance_m, input.joint_factor);
        let inverse = WeightedPseudoinverse::new(input.jacobian, &weight.diagonal);
        let (position_error, attitude_error, twist) = match input.set_point {
            None => (Vector3::zeros(), self.attitude.unchanged(), Twist::zeros()),
            Some(set_point) => self.track(input.end_effector, set_point),
        };
        OuterOutput {
            velocity: inverse.apply(&twist), // Eq 17
            twist,
            position_error,
            attitude_error,
            weight,
            inverse,
        }
    }

    fn track(&mut self, end_effector: &Pose, set_point: &SetPoint) -> (Vector3<f64>, AttitudeError, Twist) {
        let OuterParameters {
            attitude,
            attitude_gain,
            position_gain,
            ..
        } = &self.parameters;
        let q_NE = &end_effector.attitude;
        let p_e = end_effector.position - set_point.pose.position; // Eq 10
        let q_e = set_point.pose.attitude.inverse() * q_NE; // η_e = η_d* ⊗ η_E, Eq 12
        let error = self.attitude.update(attitude, &q_e);
        // Eq 13 or 17, in end-effector axes; R_eᵀ transforms the desired rate from desired to end-effector axes
        let w = q_e.inverse() * set_point.rate - attitude_gain.component_mul(&error.vector);
        // Eq 17
        let v = q_NE.inverse() * (set_point.velocity - position_gain.component_mul(&p_e));
        (p_e, error, Twist::new(w.x, w.y, w.z, v.x, v.y, v.z))
    }
}
