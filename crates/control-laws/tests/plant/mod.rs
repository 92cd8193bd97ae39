//! A plant in one loop with guidance and controller: the baseline, simulated without the framework.
//!
//! 15-DOF servicer with motor inertia, classical Runge-Kutta at 1 ms, inputs held; ideal target; guidance and controller at 10 ms without
//! delay. Order at an instant: measured state, guidance, controller, then ten steps of the plant.
#![allow(dead_code)] // each test binary uses its part

pub(crate) mod loops;

use control_laws::{Dof, Measured, ModelOptions};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, SetPoint, TargetState, so3};
use multibody::{Description, FrameId, Quaternion, State, Tree};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};

pub(crate) const URDF: &str = include_str!("../../../../models/servicer.urdf");
pub(crate) const PLANT_PERIOD_S: f64 = 0.001;
pub(crate) const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Closing pose of the base, m.
pub(crate) const NOMINAL: [f64; 3] = [-0.35, 0.0, -2.375];
/// Limits of wheels, thrusters and joints: N m, N, N m.
pub(crate) const LIMITS: [f64; 13] = [
    0.2, 0.2, 0.2, 9.0, 9.0, 9.0, 320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0,
];
/// Gains before any synthesis: mass matrix at the start times cut-offs of 1.5, 1 and 5 rad/s; K_I a fifth of the cut-off times K_P.
pub(crate) const KP: [f64; 13] = [
    146.6895, 175.3136, 109.8485, 450.2, 450.2, 450.2, 3.0471, 22.7627, 6.7286, 7.3626, 0.7976, 1.1009, 0.5140,
];
pub(crate) const KI: [f64; 13] = [
    44.0069, 52.5941, 32.9545, 90.04, 90.04, 90.04, 3.0471, 22.7627, 6.7286, 7.3626, 0.7976, 1.1009, 0.5140,
];

pub(crate) fn description() -> Description {
    Description::from_urdf(URDF).unwrap()
}

/// The servicer with the rotor inertia of its joints.
pub(crate) fn geared() -> Description {
    let mut description = description();
    for joint in ModelOptions::default().arm_joints {
        description.add_motor_inertia(&joint, 0.1).unwrap();
    }
    description
}

pub(crate) fn grasp() -> Pose {
    Pose {
        position: Vector3::new(0.0, 0.0, -0.65),
        attitude: UnitQuaternion::identity(),
    }
}

pub(crate) fn target_model() -> TargetModel {
    TargetModel::new(Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)), PLANT_PERIOD_S).unwrap()
}

/// The servicer with its propellant, and the target.
#[derive(Clone)]
pub(crate) struct Plant {
    tree: Tree<9, 15>,
    end_effector: FrameId,
    pub(crate) state: State<9, 15>,
    pub(crate) target: TargetState,
    target_model: TargetModel,
    /// Limits of the actuators.
    pub(crate) limits: [f64; 13],
}

impl Plant {
    /// At rest at `distance` times the nominal closing position, the target tumbling at `tumble` times its rate.
    pub(crate) fn new(distance: f64, tumble: f64) -> Self {
        Self::of(&geared(), distance, tumble)
    }

    /// The same with another servicer.
    pub(crate) fn of(description: &Description, distance: f64, tumble: f64) -> Self {
        let tree = Tree::<9, 15>::new(description).unwrap();
        let mut state = State::rest();
        state.p_nb = Vector3::from(NOMINAL) * distance;
        for (joint, degrees) in [(1, 40.0), (3, 80.0), (5, 40.0)] {
            state.q[joint] = degrees * DEGREE;
        }
        Self {
            end_effector: tree.frame("end_effector").unwrap(),
            tree,
            state,
            target: TargetState {
                pose: Pose {
                    position: Vector3::zeros(),
                    attitude: UnitQuaternion::identity(),
                },
                velocity: Vector3::zeros(),
                rate: Vector3::new(0.3, 0.5, 1.0) * (DEGREE * tumble),
            },
            target_model: target_model(),
            limits: LIMITS,
        }
    }

    pub(crate) fn measured(&self) -> Measured {
        let State { p_nb, quat_nb, q, nu } = &self.state;
        Measured::from_raw(
            (*p_nb).into(),
            quat_nb.to_wxyz(),
            std::array::from_fn(|joint| q[joint]),
            std::array::from_fn(|row| nu[row]),
        )
        .unwrap()
    }

    /// Motion of the end effector with the true tree.
    pub(crate) fn end_effector(&self) -> SetPoint {
        let kinematics = self.tree.kinematics(&self.state.q, &self.state.nu);
        let placement = self.tree.placement_in_world(&self.state, self.end_effector);
        let twist = self.tree.jacobian(&kinematics, self.end_effector) * self.state.nu;
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(placement.r);
        SetPoint {
            pose: Pose {
                position: placement.p,
                attitude: UnitQuaternion::from_rotation_matrix(&rotation),
            },
            velocity: placement.r * twist.fixed_rows::<3>(3),
            rate: twist.fixed_rows::<3>(0).into_owned(),
        }
    }

    /// One step with the command held, clipped at the limits of the actuators.
    pub(crate) fn step(&mut self, command: &Dof) {
        let mut force = SVector::<f64, 15>::zeros();
        for row in 0..13 {
            force[row] = command[row].clamp(-self.limits[row], self.limits[row]);
        }
        let h = PLANT_PERIOD_S;
        let start = self.state;
        let k1 = self.rate(&start, &force);
        let k2 = self.rate(&plus_rate(&start, 0.5 * h, &k1), &force);
        let k3 = self.rate(&plus_rate(&start, 0.5 * h, &k2), &force);
        let k4 = self.rate(&plus_rate(&start, h, &k3), &force);
        let mut next = start;
        for (weight, k) in [(1.0, k1), (2.0, k2), (2.0, k3), (1.0, k4)] {
            next = plus_rate(&next, h * weight / 6.0, &k);
        }
        next.quat_nb = next.quat_nb.normalized();
        self.state = next;
        self.target = self.target_model.predicted(&self.target, h);
    }

    fn rate(&self, state: &State<9, 15>, force: &SVector<f64, 15>) -> Rate {
        Rate {
            p_nb: state.quat_nb.rotate(&state.velocity()),
            quat_nb: state.quat_nb.rate(&state.omega()),
            q: state.nu.fixed_rows::<9>(6).into_owned(),
            nu: self.tree.forward_dynamics(state, force),
        }
    }
}

struct Rate {
    p_nb: Vector3<f64>,
    quat_nb: Quaternion,
    q: SVector<f64, 9>,
    nu: SVector<f64, 15>,
}

fn plus_rate(state: &State<9, 15>, step_s: f64, rate: &Rate) -> State<9, 15> {
    State {
        p_nb: state.p_nb + rate.p_nb * step_s,
        quat_nb: state.quat_nb.plus(step_s, rate.quat_nb),
        q: state.q + rate.q * step_s,
        nu: state.nu + rate.nu * step_s,
    }
}

/// Results by which a run is assessed.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Figures {
    pub(crate) position_error_m: f64,
    pub(crate) attitude_error_deg: f64,
    pub(crate) relative_speed_m_s: f64,
    pub(crate) largest_error_after_m: f64,
    pub(crate) peak_torque_nm: f64,
    pub(crate) peak_force_n: f64,
    pub(crate) peak_joint_nm: f64,
    /// Fraction of the controller's samples in which a command exceeds a wheel's limit.
    pub(crate) wheels_over: f64,
    /// Fraction of the controller's samples in which a command exceeds any actuator's limit.
    pub(crate) saturated: f64,
    pub(crate) slosh_deg: f64,
    pub(crate) joint_low_deg: [f64; 7],
    pub(crate) joint_high_deg: [f64; 7],
}

/// Runs `law` every `period_s` from 0 to `duration_s` and assesses the run with the grasp at `grasp_s`. The law receives the time and the
/// plant's true state (as from an ideal sensor and an ideal camera) and returns a command.
pub(crate) fn run(
    mut plant: Plant,
    duration_s: f64,
    grasp_s: f64,
    period_s: f64,
    mut law: impl FnMut(f64, &Plant) -> Dof,
) -> (Figures, Plant) {
    let samples = (duration_s / period_s).round() as u32;
    let steps = (period_s / PLANT_PERIOD_S).round() as u32;
    let grasp_sample = (grasp_s / period_s).round() as u32;
    let mut figures = Figures {
        joint_low_deg: [f64::INFINITY; 7],
        joint_high_deg: [f64::NEG_INFINITY; 7],
        ..Figures::default()
    };
    let (mut wheels_over, mut saturated) = (0, 0);
    for sample in 0..samples {
        let time_s = f64::from(sample) * period_s;
        let end_effector = plant.end_effector();
        let goal = plant.target.frame(&grasp());
        let error_m = (end_effector.pose.position - goal.pose.position).norm();
        if sample == grasp_sample {
            figures.position_error_m = error_m;
            let turn = goal.pose.attitude.inverse() * end_effector.pose.attitude;
            figures.attitude_error_deg = so3::log(&turn).norm() / DEGREE;
            figures.relative_speed_m_s = (end_effector.velocity - goal.velocity).norm();
        } else if sample > grasp_sample {
            figures.largest_error_after_m = figures.largest_error_after_m.max(error_m);
        }
        let command = law(time_s, &plant);
        let over: [bool; 13] = std::array::from_fn(|row| command[row].abs() > plant.limits[row]);
        wheels_over += u32::from(over[..3].contains(&true));
        saturated += u32::from(over.contains(&true));
        figures.peak_torque_nm = figures.peak_torque_nm.max(command.rows(0, 3).amax());
        figures.peak_force_n = figures.peak_force_n.max(command.rows(3, 3).amax());
        figures.peak_joint_nm = figures.peak_joint_nm.max(command.rows(6, 7).amax());
        figures.slosh_deg = figures.slosh_deg.max(plant.state.q.rows(7, 2).amax() / DEGREE);
        for joint in 0..7 {
            let degrees = plant.state.q[joint] / DEGREE;
            figures.joint_low_deg[joint] = figures.joint_low_deg[joint].min(degrees);
            figures.joint_high_deg[joint] = figures.joint_high_deg[joint].max(degrees);
        }
        for _ in 0..steps {
            plant.step(&command);
        }
    }
    figures.wheels_over = f64::from(wheels_over) / f64::from(samples);
    figures.saturated = f64::from(saturated) / f64::from(samples);
    (figures, plant)
}
