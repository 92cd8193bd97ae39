//! After the capture: the stack of servicer and target comes to rest within every limit.

mod plant;

use control_laws::stabilise::{ActiveLimit, Input, Output, Parameters};
use control_laws::{ControlModel, Dof, ModelOptions, Payload, StabilisingLaw};
use guidance_laws::{Pose, so3};
use multibody::{Description, Inertia, Joint, JointKind, Link, Placement};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use plant::{LIMITS, Plant, description, geared};

/// The target with the grasp frame on the end effector: 150 kg, 0.65 m ahead.
fn payload() -> Payload {
    Payload {
        pose: Pose {
            position: Vector3::new(0.0, 0.0, 0.65),
            attitude: UnitQuaternion::identity(),
        },
        inertia: Inertia {
            mass: 150.0,
            com: Vector3::zeros(),
            about_com: Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)),
        },
    }
}

fn stack_options() -> ModelOptions {
    ModelOptions {
        payload: Some(payload()),
        ..ModelOptions::default()
    }
}

/// The plant's description with the target welded on, implemented independently so that it checks the model's weld.
fn description_with_payload() -> Description {
    let mut description = geared();
    let parent = description
        .links
        .iter()
        .position(|link| link.name == "end_effector")
        .unwrap();
    let Payload { pose, inertia } = payload();
    description.links.push(Link {
        name: "target".to_owned(),
        inertia: Some(inertia),
    });
    description.joints.push(Joint {
        name: "grip".to_owned(),
        kind: JointKind::Fixed,
        parent,
        child: description.links.len() - 1,
        origin: Placement {
            p: pose.position,
            r: Matrix3::identity(),
        },
        axis: Vector3::z(),
        limits: None,
        damping: 0.0,
        friction: 0.0,
        stiffness: 0.0,
        rest: 0.0,
        motor_inertia: 0.0,
        mimic: None,
    });
    description
}

fn parameters() -> Parameters {
    Parameters {
        rotation_1_s: 0.2,
        translation_1_s: 0.2,
        joints_1_s: 0.2,
        limits: Dof::from(LIMITS),
        gripper_force_n: 3.0,
        gripper_torque_nm: 2.0,
        wheel_momentum_nms: Vector3::repeat(12.0),
        rest_rate_rad_s: 1e-4,
        rest_speed_m_s: 1e-4,
        allocation: None,
    }
}

fn law(parameters: Parameters) -> StabilisingLaw {
    let stack = ControlModel::new(&description(), &stack_options()).unwrap();
    let servicer = ControlModel::new(&description(), &ModelOptions::default()).unwrap();
    StabilisingLaw::new(stack, servicer, parameters).unwrap()
}

/// Rates typical after a capture: the target still turns about the gripper and the stack drifts.
fn moving_plant(scale: f64) -> Plant {
    let mut plant = Plant::of(&description_with_payload(), 1.0, 1.0);
    plant.state.nu = SVector::from([
        0.002, -0.004, 0.003, 0.004, -0.003, 0.002, 0.01, -0.012, 0.008, 0.015, -0.01, 0.02, 0.015, 0.01, -0.01,
    ]) * scale;
    plant
}

struct Rest {
    last: Output,
    wheel_momentum: Vector3<f64>,
    limited_steps: u32,
    energy: Vec<f64>,
}

fn bring_to_rest(mut plant: Plant, parameters: Parameters, duration_s: f64) -> Rest {
    let mut law = law(parameters);
    let mut wheel_momentum = Vector3::zeros();
    let (mut last, mut limited_steps, mut energy) = (None, 0, Vec::new());
    for sample in 0..(duration_s / 0.01) as u32 {
        let input = Input {
            time_s: 0.01 * f64::from(sample),
            measured: Some(plant.measured()),
            wheel_momentum,
        };
        let output = law.step(&input).unwrap();
        assert!(
            output
                .force
                .iter()
                .zip(&LIMITS)
                .all(|(force, limit)| force.abs() <= *limit)
        );
        let gripper = output.telemetry.gripper;
        assert!(gripper.fixed_rows::<3>(0).norm() <= parameters.gripper_torque_nm * (1.0 + 1e-9));
        assert!(gripper.fixed_rows::<3>(3).norm() <= parameters.gripper_force_n * (1.0 + 1e-9));
        limited_steps += u32::from(output.telemetry.active_limit != ActiveLimit::None);
        energy.push(output.telemetry.kinetic_energy_j);
        for _ in 0..10 {
            plant.step(&output.force);
        }
        wheel_momentum -= output.force.fixed_rows::<3>(0) * 0.01;
        last = Some(output);
    }
    Rest {
        last: last.unwrap(),
        wheel_momentum,
        limited_steps,
        energy,
    }
}

#[test]
fn the_stack_comes_to_rest_within_every_limit() {
    let first = law(parameters())
        .step(&Input {
            time_s: 0.0,
            measured: Some(moving_plant(1.0).measured()),
            wheel_momentum: Vector3::zeros(),
        })
        .unwrap();
    let rest = bring_to_rest(moving_plant(1.0), parameters(), 120.0);
    println!(
        "time to rest {:.1} s, wheels {:.3?} N m s (foreseen {:.3?}), held by a limit in {} samples of 12000",
        rest.last.telemetry.time_to_rest_s,
        rest.wheel_momentum.as_slice(),
        first.telemetry.wheel_momentum_at_rest.as_slice(),
        rest.limited_steps,
    );
    assert!(rest.limited_steps > 100, "the limits matter in this case");
    assert!(rest.last.telemetry.time_to_rest_s > 0.0 && rest.last.telemetry.time_to_rest_s < 100.0);
    assert!(*rest.energy.last().unwrap() < 1e-5 * rest.energy[0]);
    // the propellant, frozen in the model, may return a little energy: a tenth of a per cent of the start
    assert!(
        rest.energy
            .windows(2)
            .all(|pair| pair[1] <= pair[0] + 1e-3 * rest.energy[0])
    );
    // the base rotates, and with it the momentum in base axes: only the magnitude can be predicted
    let foreseen = first.telemetry.wheel_momentum_at_rest.norm();
    assert!((rest.wheel_momentum.norm() - foreseen).abs() < 0.05 * foreseen);
}

#[test]
fn without_limits_every_rate_dies_out_exponentially() {
    let wide = Parameters {
        limits: Dof::repeat(1e6),
        gripper_force_n: 1e6,
        gripper_torque_nm: 1e6,
        ..parameters()
    };
    // small rates: the arm hardly moves meanwhile, and the plant's limits stay inactive
    let rest = bring_to_rest(moving_plant(0.02), wide, 10.0);
    assert_eq!(rest.limited_steps, 0);
    let expected = libm::exp(-2.0 * 0.2 * 9.99);
    let ratio = rest.energy.last().unwrap() / rest.energy[0];
    assert!((ratio / expected - 1.0).abs() < 0.05, "{ratio} {expected}");
}

#[test]
fn gripper_wrench_agrees_with_newton_euler_of_the_target() {
    let plant = moving_plant(1.0);
    let measured = plant.measured();
    let mut law = law(parameters());
    let input = Input {
        time_s: 0.0,
        measured: Some(measured),
        wheel_momentum: Vector3::zeros(),
    };
    let output = law.step(&input).unwrap();
    // motion of the payload under the acceleration commanded by the law, by finite differences
    let model = ControlModel::new(&description(), &stack_options()).unwrap();
    let acceleration = measured.velocity * (-0.2 * output.telemetry.factor);
    let payload = payload();
    let motion = |step_s: f64| {
        let mut moved = measured;
        moved.velocity = measured.velocity + acceleration * step_s;
        let mean = measured.velocity + acceleration * (0.5 * step_s);
        let [wx, wy, wz, vx, vy, vz] = std::array::from_fn(|row| mean[row] * step_s);
        moved.base.position += measured.base.attitude * Vector3::new(vx, vy, vz);
        moved.base.attitude *= so3::exp(&Vector3::new(wx, wy, wz));
        for joint in 0..7 {
            moved.joints[joint] += mean[6 + joint] * step_s;
        }
        let end = model.end_effector(&moved);
        let twist = end.jacobian * moved.velocity;
        let w = end.pose.attitude * twist.fixed_rows::<3>(0);
        let v = end.pose.attitude * twist.fixed_rows::<3>(3);
        (end.pose, w, v + w.cross(&(end.pose.attitude * payload.pose.position)))
    };
    let step_s = 1e-4;
    let [(_, w0, v0), (pose, w, _), (_, w1, v1)] = [-step_s, 0.0, step_s].map(motion);
    let force = (v1 - v0) / (2.0 * step_s) * 150.0;
    let turn = pose.attitude.to_rotation_matrix().into_inner();
    let inertia = turn * payload.inertia.about_com * turn.transpose();
    let torque_about_com = inertia * ((w1 - w0) / (2.0 * step_s)) + w.cross(&(inertia * w));
    let arm = pose.attitude * payload.pose.position;
    let expected_force = pose.attitude.inverse() * force;
    let expected_torque = pose.attitude.inverse() * (torque_about_com + arm.cross(&force));
    let gripper = output.telemetry.gripper;
    assert!(
        (gripper.fixed_rows::<3>(3) - expected_force).norm() < 1e-5,
        "{gripper} {expected_force}"
    );
    assert!(
        (gripper.fixed_rows::<3>(0) - expected_torque).norm() < 1e-5,
        "{gripper} {expected_torque}"
    );
}

#[test]
fn stabilising_law_waits_for_measurement_and_restores() {
    let mut law = law(parameters());
    let mut input = Input {
        time_s: 3.0,
        measured: None,
        wheel_momentum: Vector3::zeros(),
    };
    assert!(law.step(&input).is_none());
    input.measured = Some(moving_plant(1e-6).measured());
    let output = law.step(&input).unwrap();
    assert!(output.telemetry.at_rest);
    assert_eq!(output.telemetry.time_to_rest_s, 0.0);
    let state = law.state();
    let stack = ControlModel::new(&description(), &stack_options()).unwrap();
    let servicer = ControlModel::new(&description(), &ModelOptions::default()).unwrap();
    let mut restored = StabilisingLaw::from_state(stack, servicer, parameters(), &state).unwrap();
    input.time_s = 3.01;
    assert_eq!(restored.step(&input), law.step(&input));
}

#[test]
fn parameters_out_of_range_are_refused_with_the_field() {
    let model = || ControlModel::new(&description(), &ModelOptions::default()).unwrap();
    let field = |parameters| StabilisingLaw::new(model(), model(), parameters).unwrap_err().field;
    assert_eq!(
        field(Parameters {
            rotation_1_s: 0.0,
            ..parameters()
        }),
        "rotation_1_s"
    );
    assert_eq!(
        field(Parameters {
            limits: Dof::zeros(),
            ..parameters()
        }),
        "limits"
    );
}
