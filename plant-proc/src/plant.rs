//! The plant participant.

use interfaces::{CameraPose, Command, Housekeeping, Measured, TargetState, ThrusterTorque, Truth};
use lockstep::participant::{
    Failure, Inputs, Interface, Kind, Member, Outputs, ParameterError, Participant, Setup, Step, state,
};
use multibody::{Method, Quaternion, rotation};
use nalgebra::Vector3;

use crate::actuators::{Actuators, THRUSTERS};
use crate::dynamics::{
    Bob, BodyQuantities, Forces, Grasp, Ledger, Mechanics, Model, Motion, Servicer, SteppedPlant, Target, Totals,
    quaternion_of, stop_joints,
};
use crate::parameters::{AfterGrasp, Parameters, SloshModel, Start, TargetStart};
use crate::saved::Saved;
use crate::sensors::{RandomSource, Sensors};
use crate::truth::{GraspPoses, TruthWriter};

/// The input ports, by number.
const COMMAND: usize = 0;
const COUPLES: usize = 1;
/// The output ports, by number.
const MEASURED: usize = 0;
const TARGET: usize = 1;
const CAMERA: usize = 2;
const HOUSEKEEPING: usize = 3;
pub(crate) const TRUTH: usize = 4;

/// The plant.
#[derive(Debug)]
pub struct Plant {
    pub(crate) model: Model,
    pub(crate) method: Method,
    pub(crate) substeps: u32,
    after_grasp: Option<AfterGrasp>,
    actuators: Actuators,
    sensors: Sensors,
    motion: Motion,
    target: Target,
    pub(crate) forces: Forces,
    ledger: Ledger,
    pub(crate) grasp: Option<Grasp>,
    /// The model without the target, where a grasp may change it: states from before the grasp can then be restored.
    free_model: Option<Box<Model>>,
    truth_writer: TruthWriter,
}

impl Plant {
    /// A plant at its start state.
    ///
    /// # Errors
    /// Names the rejected parameter.
    pub fn new(setup: &Setup, parameters: &Parameters) -> Result<Self, ParameterError> {
        let model = Model::new(
            &parameters.urdf,
            &parameters.servicer,
            &parameters.target,
            parameters.slosh,
        )?;
        let method = match parameters.integrator.method.parse() {
            // the ledger is integrated with the motion, which the Lie-group method does not support
            Ok(method @ (Method::Rk4 | Method::Dop853)) => method,
            _ => {
                let reason = format!(
                    "`{}` is not here; the plant's are rk4 and dop853",
                    parameters.integrator.method
                );
                return Err(ParameterError::new("integrator.method", reason));
            }
        };
        if !(1..=1000).contains(&parameters.integrator.substeps) {
            let reason = format!("{} is not between 1 and 1000", parameters.integrator.substeps);
            return Err(ParameterError::new("integrator.substeps", reason));
        }
        if let Some(gripper) = &parameters.after_grasp {
            gripper.validate()?;
        }
        let actuators = Actuators::new(
            &parameters.actuators,
            &parameters.faults,
            &parameters.servicer.arm.joints,
            setup.period,
        )?;
        let source = RandomSource {
            seed: setup.seed,
            participant: &setup.name,
            period: setup.period,
        };
        let motion = Motion {
            servicer: servicer_at_start(&parameters.start, parameters.slosh),
            bob: match parameters.slosh {
                SloshModel::Hinges => Bob::NONE,
                SloshModel::Spherical => Bob::at(parameters.start.slosh.si(), parameters.start.slosh_rates.si()),
            },
            wheel_momentum: parameters.actuators.wheels.start_momentum.si().into(),
            impulse: Vector3::zeros(),
            angular_impulse: Vector3::zeros(),
            work: 0.0,
            loss: 0.0,
        };
        let target = target_at_start(&parameters.target_start);
        let ledger = Ledger {
            start: Totals::of(&model, &motion, &target, false),
            impact_loss: 0.0,
        };
        let free_model = parameters.after_grasp.is_some().then(|| Box::new(model.clone()));
        Ok(Self {
            model,
            method,
            substeps: parameters.integrator.substeps,
            after_grasp: parameters.after_grasp.clone(),
            actuators,
            sensors: Sensors::new(&parameters.sensors, source)?,
            motion,
            target,
            forces: Forces {
                wheel_torque: Vector3::zeros(),
                compensated: [false; 3],
                thruster_force: Vector3::zeros(),
                thruster_torque: Vector3::zeros(),
                thrust: [0.0; THRUSTERS],
                joint_torque: [0.0; 7],
                braked: [false; 7],
            },
            ledger,
            grasp: None,
            free_model,
            truth_writer: TruthWriter::default(),
        })
    }

    /// The parts that a step integrates.
    pub(crate) fn stepped_parts<'a>(
        &'a mut self,
        truth_requested: bool,
        bodies: &'a mut Option<BodyQuantities>,
    ) -> SteppedPlant<'a> {
        SteppedPlant {
            model: &self.model,
            forces: &self.forces,
            motion: &mut self.motion,
            target: &mut self.target,
            truth_requested,
            bodies,
        }
    }

    /// Integrates over a step.
    pub(crate) fn integrate(&mut self, period: f64) {
        let mechanics = Mechanics { model: &self.model };
        let h = period / f64::from(self.substeps);
        for _ in 0..self.substeps {
            self.motion = match self.method {
                Method::Dop853 => multibody::dop853(&mechanics, &self.motion, &self.forces, h),
                _ => multibody::rk4(&mechanics, &self.motion, &self.forces, h),
            };
            if self.grasp.is_none() {
                self.target = self
                    .model
                    .target
                    .step(self.method, &self.target, &nalgebra::SVector::zeros(), h);
            }
        }
        self.update_held_target();
    }

    /// Updates the target's motion from the end effector's while it is held.
    pub(crate) fn update_held_target(&mut self) {
        if let Some(grasp) = &self.grasp {
            self.target = self.model.held_target_motion(&self.motion.servicer, &grasp.held);
        }
    }

    /// Closes the gripper at `t` if its time has come and the end effector is near enough. The outputs already written for `t`
    /// remain those of the state just before the impact.
    fn try_grasp(&mut self, t: f64) {
        let Some(after) = &self.after_grasp else {
            return;
        };
        // half a nanosecond: the plant's times and the scenario's times are rounded separately
        if self.grasp.is_some() || t < after.at.si() - 5e-10 {
            return;
        }
        let (within, within_angle) = (after.within.si(), after.within_angle.si());
        let servicer = &self.motion.servicer;
        let kinematics = self.model.kinematics(servicer);
        let end_effector = self.model.tree.placement(&kinematics, self.model.end_effector);
        let poses = GraspPoses::of(&self.model, &end_effector, servicer, &self.target);
        if poses.distance() <= within && poses.angle() <= within_angle {
            self.grasp = self.model.grasp(&mut self.motion, &mut self.target);
            self.ledger.impact_loss += self.grasp.map_or(0.0, |grasp| grasp.loss);
        }
    }

    /// Start of a step: the gripper closes, the actuators take their commands, brakes engage.
    pub(crate) fn begin_step(&mut self, step: &Step, inputs: &Inputs) {
        self.try_grasp(step.t);
        let forces = self.actuators.apply(
            step.t,
            inputs.get::<Command>(COMMAND),
            inputs.get::<ThrusterTorque>(COUPLES),
            &self.motion.wheel_momentum,
            &self.motion.servicer.omega(),
        );
        if forces
            .braked
            .iter()
            .zip(&self.forces.braked)
            .any(|(now, before)| *now && !before)
        {
            self.ledger.impact_loss += stop_joints(&self.model, &mut self.motion, &forces.braked);
        }
        self.forces = forces;
    }

    fn truth(&mut self, bodies: Option<&BodyQuantities>) -> Truth {
        let (forces, ledger) = (&self.forces, &self.ledger);
        let computed;
        let bodies = match bodies {
            Some(bodies) => bodies,
            None => {
                computed = BodyQuantities::of(&self.model, &self.motion);
                &computed
            }
        };
        self.truth_writer.message(
            &self.model,
            (&self.motion, bodies),
            &self.target,
            forces,
            ledger,
            self.grasp.is_some(),
        )
    }

    /// Writes sample number `k` at `t`, s, of each output that is read. `bodies`: the body quantities for the truth, if already computed.
    pub(crate) fn write_outputs(&mut self, k: u64, t: f64, bodies: Option<&BodyQuantities>, outputs: &mut Outputs) {
        if outputs.is_seen(TRUTH) {
            *outputs.get_mut::<Truth>(TRUTH) = self.truth(bodies);
        } else if outputs.is_ever_seen(TRUTH) {
            self.truth_writer.update_signs(&self.model, &self.motion, &self.target);
        }
        // A reading that affects later samples is taken even if this sample is not read.
        let sensors = &mut self.sensors.servicer;
        if outputs.is_seen(MEASURED) || (outputs.is_ever_seen(MEASURED) && sensors.has_memory()) {
            *outputs.get_mut::<Measured>(MEASURED) = *sensors.read(k, &self.motion.servicer);
        }
        if outputs.is_ever_seen(CAMERA) {
            *outputs.get_mut::<CameraPose>(CAMERA) = *self.sensors.camera.read(k, t, &self.target);
        }
        let target = &self.target;
        if outputs.is_seen(TARGET) {
            *outputs.get_mut::<TargetState>(TARGET) = TargetState {
                stamp: t,
                p_NT_N: target.p_nb.into(),
                quat_NT: target.quat_nb.to_wxyz(),
                v_NT_N: target.quat_nb.rotate(&target.velocity()).into(),
                omega_NT_T: target.omega().into(),
            };
        }
        if outputs.is_seen(HOUSEKEEPING) {
            let held = self.grasp.map(|grasp| grasp.held);
            *outputs.get_mut::<Housekeeping>(HOUSEKEEPING) = Housekeeping {
                wheel_momentum_B: self.motion.wheel_momentum.into(),
                p_ET_E: held.map_or([0.0; 3], |held| held.p.into()),
                quat_ET: held.map_or([0.0; 4], |held| quaternion_of(&held.r).to_wxyz()),
                grasped: held.is_some(),
                padding: [0; 7],
            };
        }
    }
}

impl Participant for Plant {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Continuous)
            .input::<Command>("command")
            .optional_input::<ThrusterTorque>("couples")
            .output::<Measured>("measured")
            .output::<TargetState>("target")
            .output::<CameraPose>("camera")
            .output::<Housekeeping>("housekeeping")
            .output::<Truth>("truth")
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.write_outputs(0, t, None, outputs);
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.begin_step(step, inputs);
        self.integrate(step.period);
        self.write_outputs(step.index + 1, step.t_next, None, outputs);
        Ok(())
    }

    fn batch_member(&mut self) -> Option<Member<'_>> {
        Some(Member::of(self))
    }

    fn save(&self) -> Option<Vec<u8>> {
        state::to_bytes(&Saved {
            motion: self.motion,
            target: self.target,
            forces: self.forces,
            actuators: self.actuators.state(),
            sensors: self.sensors.state(),
            ledger: self.ledger,
            totals: Totals::of(&self.model, &self.motion, &self.target, self.grasp.is_some()),
            grasp: self.grasp,
            signs: self.truth_writer.last,
        })
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        let saved: Saved = state::from_bytes(state)?;
        let spherical = self.model.spherical.is_some();
        if spherical == (saved.motion.bob == Bob::NONE) {
            let [own, other] = if spherical {
                ["spherical", "hinges"]
            } else {
                ["hinges", "spherical"]
            };
            return Err(format!("it is of a plant with `slosh = \"{other}\"`, and this one has \"{own}\"").into());
        }
        let free = self.free_model.get_or_insert_with(|| Box::new(self.model.clone()));
        if self.grasp.is_some() {
            self.model.clone_from(free);
        }
        if let Some(grasp) = &saved.grasp {
            self.model.weld_target(&grasp.held);
        }
        (self.motion, self.target, self.grasp) = (saved.motion, saved.target, saved.grasp);
        let totals = Totals::of(&self.model, &self.motion, &self.target, self.grasp.is_some());
        (self.forces, self.ledger) = (saved.forces, saved.ledger.after_change(&saved.totals, &totals));
        self.actuators.restore(&saved.actuators);
        self.sensors.restore(&saved.sensors);
        self.truth_writer.last = saved.signs;
        Ok(())
    }
}

fn quaternion([roll, pitch, yaw]: [f64; 3]) -> Quaternion {
    if [roll, pitch, yaw] == [0.0; 3] {
        return Quaternion::IDENTITY;
    }
    quaternion_of(&rotation::roll_pitch_yaw(roll, pitch, yaw))
}

fn servicer_at_start(start: &Start, slosh: SloshModel) -> Servicer {
    let mut state = Servicer::rest();
    state.p_nb = start.position.si().into();
    state.quat_nb = quaternion(start.attitude.si());
    let q = start.joints.si().into_iter().chain(start.slosh.si());
    state.q.iter_mut().zip(q).for_each(|(slot, value)| *slot = value);
    let nu = start.rate.si().into_iter().chain(start.velocity.si());
    let nu = nu.chain(start.joint_rates.si()).chain(start.slosh_rates.si());
    state.nu.iter_mut().zip(nu).for_each(|(slot, value)| *slot = value);
    if slosh == SloshModel::Spherical {
        // the bob has a separate state
        state.q.iter_mut().skip(7).for_each(|angle| *angle = 0.0);
        state.nu.iter_mut().skip(13).for_each(|rate| *rate = 0.0);
    }
    state
}

fn target_at_start(start: &TargetStart) -> Target {
    let mut state = Target::rest();
    state.p_nb = start.position.si().into();
    state.quat_nb = quaternion(start.attitude.si());
    let v = state.quat_nb.rotate_back(&start.velocity.si().into());
    let nu = start.rate.si().into_iter().chain(v.iter().copied());
    state.nu.iter_mut().zip(nu).for_each(|(slot, value)| *slot = value);
    state
}
