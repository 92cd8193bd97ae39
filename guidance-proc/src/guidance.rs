//! The guidance participant.

use guidance_laws::capture::Phase;
use guidance_laws::navigation::{CameraPose as CameraMeasurement, NavigationFilter, Update};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, SetPoint as SetPointState, TargetState as TargetMotion, so3};
use interfaces::{CameraPose, GuidancePhase, GuidanceTelemetry, Measured, SetPoint, TargetState};
use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Step};

use crate::kinematics::Kinematics;
use crate::law::{Law, LawOutput};
use crate::navigation::Navigation;
use crate::parameters::{Parameters, scenario_error};
use crate::saved;

/// The input ports, by number.
const MEASURED: usize = 0;
const TARGET: usize = 1;
const CAMERA: usize = 2;
/// The output ports, by number.
const SETPOINT: usize = 0;
const BASE_SETPOINT: usize = 1;
const TELEMETRY: usize = 2;

/// The guidance.
#[derive(Debug)]
pub struct Guidance {
    kinematics: Kinematics,
    pub(crate) law: Law,
    pub(crate) navigation: Option<Navigation>,
    /// Model for propagating a delayed target state to the present.
    prediction: Option<TargetModel>,
}

/// Estimate of the target's motion.
#[derive(Debug, Clone, Copy, Default)]
struct TargetEstimate {
    target: Option<TargetMotion>,
    sigma_position: f64,
    sigma_attitude: f64,
    age: f64,
}

impl Guidance {
    /// A guidance before its first input.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(parameters: &Parameters) -> Result<Self, ParameterError> {
        parameters.target.validate()?;
        let navigation = match &parameters.navigation {
            None => None,
            Some(navigation) => {
                let parameters = parameters.filter(navigation)?;
                Some(Navigation {
                    filter: NavigationFilter::new(parameters).map_err(|error| scenario_error(&error))?,
                    parameters,
                    rejected: 0,
                    innovation: 0.0,
                })
            }
        };
        Ok(Self {
            kinematics: Kinematics::new(&parameters.urdf, &parameters.servicer)?,
            law: Law::new(parameters)?,
            navigation,
            prediction: match parameters.predict_target {
                true => Some(parameters.target_model(0.01)?),
                false => None,
            },
        })
    }

    fn estimate_target(&mut self, t: f64, inputs: &Inputs) -> TargetEstimate {
        match &mut self.navigation {
            Some(navigation) => navigation.estimate_target(t, inputs.get(CAMERA)),
            None => {
                let message = inputs.get::<TargetState>(TARGET);
                let received =
                    TargetMotion::from_raw(message.p_NT_N, message.quat_NT, message.v_NT_N, message.omega_NT_T);
                let age = received.map_or(0.0, |_| t - message.stamp);
                let target = match (&received, &self.prediction) {
                    (Some(received), Some(model)) => Some(model.predicted(received, age)),
                    _ => received,
                };
                TargetEstimate {
                    target,
                    age,
                    ..TargetEstimate::default()
                }
            }
        }
    }
}

impl Navigation {
    fn estimate_target(&mut self, t: f64, message: &CameraPose) -> TargetEstimate {
        let measurement = Pose::from_raw(message.p_NT_N, message.quat_NT).map(|pose| CameraMeasurement {
            stamp_s: message.stamp,
            pose,
        });
        let Some(estimate) = self.filter.step(t, measurement.as_ref()) else {
            return TargetEstimate::default();
        };
        match estimate.update {
            Update::None | Update::Started => {}
            Update::Accepted { nis } => self.innovation = nis,
            Update::Rejected { nis } => {
                // the message must stay finite whatever the camera pose was
                self.innovation = nis.min(f64::MAX);
                self.rejected += 1;
            }
        }
        TargetEstimate {
            target: Some(estimate.target),
            sigma_position: estimate.position_sigma_m,
            sigma_attitude: estimate.attitude_sigma_rad,
            age: estimate.age_s,
        }
    }
}

impl Participant for Guidance {
    fn interface(&self) -> Interface {
        let interface = Interface::new(Kind::Sampled).input::<Measured>("measured");
        let interface = match self.navigation {
            None => interface
                .input::<TargetState>("target")
                .optional_input::<CameraPose>("camera"),
            Some(_) => interface
                .optional_input::<TargetState>("target")
                .input::<CameraPose>("camera"),
        };
        interface
            .output::<SetPoint>("setpoint")
            .output::<SetPoint>("base_setpoint")
            .output::<GuidanceTelemetry>("telemetry")
    }

    fn initialise(&mut self, _: f64, _: &mut Outputs) -> Result<(), Failure> {
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        let poses = self.kinematics.poses(inputs.get(MEASURED));
        let estimated = self.estimate_target(step.t, inputs);
        let output = self.law.step(step.t, poses, estimated.target);
        *outputs.get_mut::<SetPoint>(SETPOINT) = message(step.t, output.end_effector.set_point);
        *outputs.get_mut::<SetPoint>(BASE_SETPOINT) = message(step.t, output.base);
        *outputs.get_mut::<GuidanceTelemetry>(TELEMETRY) = telemetry(&output, &estimated, self.navigation.as_ref());
        Ok(())
    }

    fn save(&self) -> Option<Vec<u8>> {
        saved::save(&self.law, self.navigation.as_ref())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        saved::restore(&mut self.law, self.navigation.as_mut(), state)
    }
}

/// Converts a set-point to a message; zeros while there is none.
fn message(stamp: f64, set_point: Option<SetPointState>) -> SetPoint {
    set_point.map_or_else(SetPoint::default, |set_point| SetPoint {
        stamp,
        p_ND_N: set_point.pose.position.into(),
        quat_ND: so3::to_wxyz(&set_point.pose.attitude),
        v_ND_N: set_point.velocity.into(),
        omega_ND_D: set_point.rate.into(),
    })
}

fn telemetry(output: &LawOutput, estimated: &TargetEstimate, navigation: Option<&Navigation>) -> GuidanceTelemetry {
    let mut telemetry = GuidanceTelemetry {
        progress_position: output.end_effector.position.value,
        progress_attitude: output.end_effector.attitude.value,
        sigma_position: estimated.sigma_position,
        sigma_attitude: estimated.sigma_attitude,
        target_age: estimated.age,
        innovation: navigation.map_or(0.0, |navigation| navigation.innovation),
        refused: navigation.map_or(0, |navigation| u32::try_from(navigation.rejected).unwrap_or(u32::MAX)),
        phase: match output.end_effector.phase {
            Phase::Waiting => GuidancePhase::Waiting,
            Phase::Pointing => GuidancePhase::Pointing,
            Phase::Closing => GuidancePhase::Closing,
            Phase::Tracking => GuidancePhase::Tracking,
        },
        ..GuidanceTelemetry::default()
    };
    if let Some(target) = &estimated.target {
        telemetry.p_NT_N = target.pose.position.into();
        telemetry.quat_NT = so3::to_wxyz(&target.pose.attitude);
        telemetry.v_NT_N = target.velocity.into();
        telemetry.omega_NT_T = target.rate.into();
    }
    telemetry
}
