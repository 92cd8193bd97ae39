//! Sensors of the servicer's own state.

use interfaces::{JOINTS, Measured};
use lockstep::participant::ParameterError;
use multibody::Quaternion;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{RandomSource, SensorErrorState, SensorErrors, SensorParameters};
use crate::dynamics::Servicer;

/// Complete state of these sensors: the errors, and the held readings.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ServicerSensorsState {
    errors: [SensorErrorState; 6],
    held: [f64; 27],
}

/// Sensors of base and joints.
#[derive(Debug, Clone)]
pub struct ServicerSensors {
    position: SensorErrors<3>,
    attitude: SensorErrors<3>,
    rate: SensorErrors<3>,
    velocity: SensorErrors<3>,
    joint_angle: SensorErrors<JOINTS>,
    joint_rate: SensorErrors<JOINTS>,
    held: Measured,
}

impl ServicerSensors {
    /// Sensors before their first reading.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(parameters: &SensorParameters, source: RandomSource) -> Result<Self, ParameterError> {
        Ok(Self {
            position: SensorErrors::new("sensors.position", &parameters.position, source)?,
            attitude: SensorErrors::new("sensors.attitude", &parameters.attitude, source)?,
            rate: SensorErrors::new("sensors.rate", &parameters.rate, source)?,
            velocity: SensorErrors::new("sensors.velocity", &parameters.velocity, source)?,
            joint_angle: SensorErrors::new("sensors.joint_angle", &parameters.joint_angle, source)?,
            joint_rate: SensorErrors::new("sensors.joint_rate", &parameters.joint_rate, source)?,
            held: Measured::default(),
        })
    }

    pub fn state(&self) -> ServicerSensorsState {
        let Measured {
            p_NB_N,
            quat_NB,
            q,
            omega_NB_B,
            v_NB_B,
            qdot,
        } = &self.held;
        let mut held = [0.0; 27];
        let values = p_NB_N.iter().chain(quat_NB).chain(q).chain(omega_NB_B).chain(v_NB_B);
        for (slot, value) in held.iter_mut().zip(values.chain(qdot)) {
            *slot = *value;
        }
        ServicerSensorsState {
            errors: [
                self.position.state(),
                self.attitude.state(),
                self.rate.state(),
                self.velocity.state(),
                self.joint_angle.state(),
                self.joint_rate.state(),
            ],
            held,
        }
    }

    pub fn restore(&mut self, state: &ServicerSensorsState) {
        let [position, attitude, rate, velocity, joint_angle, joint_rate] = &state.errors;
        self.position.restore(position);
        self.attitude.restore(attitude);
        self.rate.restore(rate);
        self.velocity.restore(velocity);
        self.joint_angle.restore(joint_angle);
        self.joint_rate.restore(joint_rate);
        let mut rest = state.held.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        self.held = Measured {
            p_NB_N: std::array::from_fn(|_| next()),
            quat_NB: std::array::from_fn(|_| next()),
            q: std::array::from_fn(|_| next()),
            omega_NB_B: std::array::from_fn(|_| next()),
            v_NB_B: std::array::from_fn(|_| next()),
            qdot: std::array::from_fn(|_| next()),
        };
    }

    /// Whether a reading depends on earlier readings.
    pub fn has_memory(&self) -> bool {
        let three = [&self.position, &self.attitude, &self.rate, &self.velocity];
        let seven = [&self.joint_angle, &self.joint_rate];
        three.into_iter().any(SensorErrors::has_memory) || seven.into_iter().any(SensorErrors::has_memory)
    }

    /// The readings at the plant's output number `k`.
    pub fn read(&mut self, k: u64, servicer: &Servicer) -> &Measured {
        let held = &mut self.held;
        if let Some(n) = self.position.due(k) {
            held.p_NB_N = self.position.read(n, servicer.p_nb.into());
        }
        if let Some(n) = self.attitude.due(k) {
            let error = self.attitude.read(n, [0.0; 3]);
            // an exact sensor returns the attitude bit for bit
            held.quat_NB = if error == [0.0; 3] {
                servicer.quat_nb.to_wxyz()
            } else {
                let disturbed = servicer.quat_nb.times(Quaternion::exp(&Vector3::from(error)));
                disturbed.normalized().to_wxyz()
            };
        }
        if let Some(n) = self.rate.due(k) {
            held.omega_NB_B = self.rate.read(n, servicer.omega().into());
        }
        if let Some(n) = self.velocity.due(k) {
            held.v_NB_B = self.velocity.read(n, servicer.velocity().into());
        }
        if let Some(n) = self.joint_angle.due(k) {
            held.q = self.joint_angle.read(n, std::array::from_fn(|joint| servicer.q[joint]));
        }
        if let Some(n) = self.joint_rate.due(k) {
            held.qdot = self
                .joint_rate
                .read(n, std::array::from_fn(|joint| servicer.nu[6 + joint]));
        }
        held
    }
}
