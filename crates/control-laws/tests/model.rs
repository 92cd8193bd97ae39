//! The control model against reference values of the baseline servicer, and its options against each other.

#![allow(non_snake_case)] // R as in the equations

mod plant;

use control_laws::model::{LinkMismatch, ModelError, Propellant};
use control_laws::{ControlModel, Dof, Measured, ModelOptions, Payload};
use guidance_laws::{Pose, so3};
use multibody::Inertia;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use plant::{DEGREE, Plant, description};

fn options_without_motor_inertia() -> ModelOptions {
    ModelOptions {
        motor_inertia_kg_m2: [0.0; 7],
        ..ModelOptions::default()
    }
}

fn model(options: &ModelOptions) -> ControlModel {
    ControlModel::new(&description(), options).unwrap()
}

fn start() -> Measured {
    Plant::new(1.0, 1.0).measured()
}

fn mass_diagonal(model: &ControlModel) -> Dof {
    model.tree().mass_matrix(&start().joints.into()).diagonal()
}

/// Reference values of an independent model of the same description, propellant frozen, no motor inertia.
#[test]
fn baseline_mass_properties_match_the_independent_model() {
    let model = model(&options_without_motor_inertia());
    let expected = [
        97.793, 116.876, 73.232, 450.2, 450.2, 450.2, 0.50942, 4.45255, 1.24572, 1.37253, 0.05952, 0.12018, 0.00281,
    ];
    for (channel, (found, expected)) in mass_diagonal(&model).iter().zip(expected).enumerate() {
        let half_digit = if channel < 3 { 5.1e-4 } else { 5.1e-6 };
        assert!((found - expected).abs() < half_digit, "{channel}: {found} {expected}");
    }
    let com = model.centre_of_mass(&start());
    assert!(
        (com - Vector3::new(0.02936, -0.00002, 0.06219)).amax() < 5.1e-6,
        "{com}"
    );
}

#[test]
fn motor_inertia_replaces_and_mismatch_scales() {
    let plain = mass_diagonal(&model(&options_without_motor_inertia()));
    let geared = mass_diagonal(&model(&ModelOptions::default()));
    for joint in 6..13 {
        assert!((geared[joint] - plain[joint] - 0.1).abs() < 1e-12);
    }
    let heavy = mass_diagonal(&model(&ModelOptions {
        mass_factor: 1.2,
        ..options_without_motor_inertia()
    }));
    assert!((heavy - plain * 1.2).amax() < 1e-10);
    let base = mass_diagonal(&model(&ModelOptions {
        mismatch: vec![LinkMismatch {
            link: "base".to_owned(),
            mass_factor: 1.1,
            inertia_factor: 1.5,
        }],
        ..options_without_motor_inertia()
    }));
    // 400 kg of bus and its inertia about the centre, where B is
    assert!((base[3] - plain[3] - 40.0).abs() < 1e-9);
    assert!((base[0] - plain[0] - 60.333333 * (1.1 * 1.5 - 1.0)).abs() < 1e-9);
    assert_eq!(base[6], plain[6]);
}

#[test]
fn propellant_is_a_rigid_mass_or_left_out() {
    let mass = |propellant| {
        mass_diagonal(&model(&ModelOptions {
            propellant,
            ..options_without_motor_inertia()
        }))[3]
    };
    assert!((mass(Propellant::Frozen) - 450.2).abs() < 1e-9);
    assert!((mass(Propellant::Ignored) - (450.2 - 10.61)).abs() < 1e-9);
}

#[test]
fn a_payload_adds_its_momentum() {
    let payload = Payload {
        pose: Pose {
            position: Vector3::new(0.1, -0.2, 0.65),
            attitude: so3::exp(&Vector3::new(0.3, 0.2, -0.4)),
        },
        inertia: Inertia {
            mass: 150.0,
            com: Vector3::new(0.01, 0.02, 0.03),
            about_com: Matrix3::from_diagonal(&Vector3::new(33.6, 30.0, 25.0)),
        },
    };
    let (alone, loaded) = (
        model(&options_without_motor_inertia()),
        model(&ModelOptions {
            payload: Some(payload),
            ..options_without_motor_inertia()
        }),
    );
    let mut measured = start();
    measured.velocity = Dof::from_fn(|row, _| 0.1 * libm::cos(1.0 + row as f64));
    let added = loaded.momentum(&measured) - alone.momentum(&measured);
    // the payload's own momentum, taken about B
    let end = alone.end_effector(&measured);
    let twist = end.jacobian * measured.velocity;
    let (w, v) = (
        end.pose.attitude * twist.fixed_rows::<3>(0),
        end.pose.attitude * twist.fixed_rows::<3>(3),
    );
    let attitude: UnitQuaternion<f64> = end.pose.attitude * payload.pose.attitude;
    let centre = end.pose.attitude * payload.pose.position + attitude * payload.inertia.com;
    let linear = (v + w.cross(&centre)) * 150.0;
    let R = attitude.to_rotation_matrix().into_inner();
    let angular = R * payload.inertia.about_com * R.transpose() * w
        + (end.pose.position + centre - measured.base.position).cross(&linear);
    let to_base = measured.base.attitude.inverse();
    assert!((added.fixed_rows::<3>(3) - to_base * linear).norm() < 1e-10);
    assert!((added.fixed_rows::<3>(0) - to_base * angular).norm() < 1e-10);
}

#[test]
fn the_jacobian_is_the_derivative_of_the_pose() {
    let model = model(&options_without_motor_inertia());
    let mut measured = start();
    measured.base.attitude = so3::exp(&Vector3::new(0.4, -0.3, 0.2));
    measured.joints = std::array::from_fn(|joint| 0.3 * joint as f64 - 0.8);
    let end = model.end_effector(&measured);
    for column in 0..13 {
        let step = 1e-6;
        let [before, after] = [-step, step].map(|step| {
            let mut moved = measured;
            match column {
                0..3 => moved.base.attitude *= so3::exp(&Vector3::ith(column, step)),
                3..6 => moved.base.position += measured.base.attitude * Vector3::ith(column - 3, step),
                _ => moved.joints[column - 6] += step,
            }
            model.end_effector(&moved).pose
        });
        let w = so3::log(&(before.attitude.inverse() * after.attitude)) / (2.0 * step);
        let v = end.pose.attitude.inverse() * (after.position - before.position) / (2.0 * step);
        assert!(
            (end.jacobian.fixed_view::<3, 1>(0, column) - w).norm() < 1e-8,
            "{column}"
        );
        assert!(
            (end.jacobian.fixed_view::<3, 1>(3, column) - v).norm() < 1e-8,
            "{column}"
        );
    }
}

#[test]
fn plant_and_model_agree_on_the_end_effector_pose() {
    let mut plant = Plant::new(1.2, 1.0);
    plant.state.quat_nb = multibody::Quaternion::exp(&Vector3::new(0.1, 0.5, -0.2));
    plant.state.q[2] = 30.0 * DEGREE;
    let (truth, believed) = (
        plant.end_effector().pose,
        model(&options_without_motor_inertia())
            .end_effector(&plant.measured())
            .pose,
    );
    assert!((truth.position - believed.position).norm() < 1e-14);
    assert!(truth.attitude.angle_to(&believed.attitude) < 1e-12);
}

#[test]
fn options_that_do_not_fit_are_rejected_by_name() {
    let refused = |options: ModelOptions| ControlModel::new(&description(), &options).unwrap_err();
    let error = refused(ModelOptions {
        end_effector: "hand".to_owned(),
        ..options_without_motor_inertia()
    });
    assert!(
        error.to_string().contains("hand") && error.to_string().contains("end_effector"),
        "{error}"
    );
    let mut order = options_without_motor_inertia();
    order.arm_joints.swap(0, 1);
    assert!(matches!(refused(order), ModelError::JointOrder { .. }));
    let mut unknown = options_without_motor_inertia();
    unknown.arm_joints[6] = "A8".to_owned();
    let error = refused(unknown).to_string();
    assert!(error.contains("`A8`") && error.contains("A1, A2"), "{error}");
    let mut inertia = options_without_motor_inertia();
    inertia.motor_inertia_kg_m2[2] = -0.1;
    assert!(refused(inertia).to_string().contains("A3"));
    let factor = refused(ModelOptions {
        mass_factor: f64::NAN,
        ..options_without_motor_inertia()
    });
    assert!(factor.to_string().contains("NaN"), "{factor}");
}
