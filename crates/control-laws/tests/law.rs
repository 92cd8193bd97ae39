//! Both laws at single instants: behaviour without inputs, saved state, and rejected parameters.

#![allow(non_snake_case)] // M and C as in the equations

mod plant;

use control_laws::avoidance::AvoidanceParameters;
use control_laws::outer::ArmWeight;
use control_laws::{ComparisonLaw, Dof, HierarchicalLaw, Measured, comparison, hierarchical};
use guidance_laws::{InterSample, Pose, SetPoint, so3};
use nalgebra::Vector3;
use plant::Plant;
use plant::loops::{baseline, model, tracker};
use proptest::prelude::*;

fn input(measured: Option<Measured>, set_point: Option<SetPoint>) -> hierarchical::Input {
    hierarchical::Input {
        measured,
        set_point,
        set_point_age_s: 0.0,
        wheel_momentum: Vector3::zeros(),
    }
}

fn law() -> HierarchicalLaw {
    HierarchicalLaw::new(model(), baseline()).unwrap()
}

fn array<const N: usize>(range: f64) -> impl Strategy<Value = [f64; N]> {
    proptest::array::uniform(-range..range)
}

/// Servicers at any position, in any attitude and configuration, with moderate velocities.
fn measured() -> impl Strategy<Value = Measured> {
    (array::<3>(6.0), array::<3>(3.0), array::<7>(2.0), array::<13>(0.2)).prop_map(
        |(position, turn, joints, velocity)| Measured {
            base: Pose {
                position: position.into(),
                attitude: so3::exp(&turn.into()),
            },
            joints,
            velocity: velocity.into(),
        },
    )
}

fn set_point() -> impl Strategy<Value = SetPoint> {
    (array::<3>(6.0), array::<3>(3.0), array::<3>(0.3), array::<3>(0.3)).prop_map(|(position, turn, velocity, rate)| {
        SetPoint {
            pose: Pose {
                position: position.into(),
                attitude: so3::exp(&turn.into()),
            },
            velocity: velocity.into(),
            rate: rate.into(),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn virtual_velocity_gives_the_error_removing_twist(
        measured in measured(), set_point in set_point(),
    ) {
        let mut law = law();
        let output = law.step(&input(Some(measured), Some(set_point))).unwrap();
        let end = law.model().end_effector(&measured);
        let twist = end.jacobian * output.telemetry.virtual_velocity;
        // with these velocities the position error decays as ṗ_e = −K p_e, the inverse of Eq 17
        let velocity = end.pose.attitude * twist.fixed_rows::<3>(3) - set_point.velocity;
        prop_assert!((velocity + (end.pose.position - set_point.pose.position)).norm() < 1e-9);
        // and so does the angle: the rate less the transformed rate of the desired frame is the feedback alone
        let error = set_point.pose.attitude.inverse() * end.pose.attitude;
        let relative = twist.fixed_rows::<3>(0) - error.inverse() * set_point.rate;
        let gain = baseline().outer.attitude_gain;
        let feedback = gain.component_mul(&output.telemetry.attitude_error.vector);
        prop_assert!((relative + feedback).norm() < 1e-9);
        prop_assert!(feedback.dot(&so3::log(&error)) >= 0.0);
        prop_assert!(output.force.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn the_force_is_feedback_plus_model(measured in measured(), set_point in set_point()) {
        // Eq 5 with explicit matrices instead of the single pass that the law uses
        let mut law = law();
        let output = law.step(&input(Some(measured), Some(set_point))).unwrap();
        let tree = law.model().tree();
        let kinematics = tree.kinematics(&measured.joints.into(), &measured.velocity);
        let (M, C) = tree.mass_and_coriolis(&kinematics);
        let t = &output.telemetry;
        let expected = t.feedback + M * t.virtual_acceleration + C * t.virtual_velocity;
        prop_assert!((output.force - expected).amax() < 1e-9 * (1.0 + expected.amax()));
        prop_assert!((t.velocity_error - (t.virtual_velocity - measured.velocity)).amax() == 0.0);
    }

    #[test]
    fn missing_set_point_holds_the_end_effector_without_nan(measured in measured()) {
        let mut law = law();
        let output = law.step(&input(Some(measured), None)).unwrap();
        let t = &output.telemetry;
        prop_assert!(!t.tracking);
        prop_assert_eq!(t.virtual_velocity, Dof::zeros());
        prop_assert_eq!(t.position_error.norm() + t.attitude_error.vector.norm(), 0.0);
        prop_assert!(output.force.iter().all(|value| value.is_finite()));
        // the force brakes: it removes kinetic energy
        prop_assert!(output.force.dot(&measured.velocity) <= 0.0);
    }

    #[test]
    fn a_restored_law_continues_with_the_same_bits(
        path in proptest::collection::vec((measured(), proptest::option::of(set_point())), 12), split in 1_usize..12,
    ) {
        let mut whole = law();
        for (measured, set_point) in &path[..split] {
            whole.step(&input(Some(*measured), *set_point));
        }
        let mut restored = HierarchicalLaw::from_state(model(), baseline(), &whole.state()).unwrap();
        for (measured, set_point) in &path[split..] {
            let input = input(Some(*measured), *set_point);
            prop_assert_eq!(restored.step(&input), whole.step(&input));
            prop_assert_eq!(restored.state(), whole.state());
        }
    }

    #[test]
    fn a_restored_comparison_law_continues_with_the_same_bits(
        path in proptest::collection::vec((measured(), set_point(), proptest::option::of(set_point())), 12), split in 1_usize..12,
    ) {
        let parameters = comparison::Parameters::new(tracker(0.01));
        let at = |(measured, end_effector, base): &(Measured, SetPoint, Option<SetPoint>)| comparison::Input {
            measured: Some(*measured),
            end_effector: Some(*end_effector),
            base: *base,
            set_point_age_s: 0.004,
            wheel_momentum: Vector3::zeros(),
        };
        let mut whole = ComparisonLaw::new(model(), parameters).unwrap();
        for instant in &path[..split] {
            whole.step(&at(instant));
        }
        let mut restored = ComparisonLaw::from_state(model(), parameters, &whole.state()).unwrap();
        for instant in &path[split..] {
            prop_assert_eq!(restored.step(&at(instant)), whole.step(&at(instant)));
        }
    }

    #[test]
    fn comparison_law_gives_both_frames_their_commanded_twists(
        measured in measured(), end_effector in set_point(), base in set_point(),
    ) {
        let mut parameters = comparison::Parameters::new(tracker(0.01));
        parameters.least_squares_damping = 1e-6;
        let mut law = ComparisonLaw::new(model(), parameters).unwrap();
        let end = law.model().end_effector(&measured);
        // away from singular arm configurations the damping has no effect
        let arm = end.jacobian.fixed_columns::<7>(6).into_owned();
        prop_assume!((arm * arm.transpose()).determinant() > 1e-4);
        let output = law.step(&comparison::Input {
            measured: Some(measured),
            end_effector: Some(end_effector),
            base: Some(base),
            set_point_age_s: 0.0,
            wheel_momentum: Vector3::zeros(),
        }).unwrap();
        let v = output.telemetry.virtual_velocity;
        let twist = end.jacobian * v;
        let velocity = end.pose.attitude * twist.fixed_rows::<3>(3) - end_effector.velocity;
        prop_assert!((velocity + output.telemetry.position_error).norm() < 1e-5 * (1.0 + v.norm()));
        let base_velocity = measured.base.attitude * v.fixed_rows::<3>(3) - base.velocity;
        prop_assert!((base_velocity + output.telemetry.base_position_error * 0.3).norm() < 1e-12);
    }
}

#[test]
fn missing_measurement_gives_no_command_and_changes_no_state() {
    let mut law = law();
    let before = law.state();
    let goal = Plant::new(1.0, 1.0).end_effector();
    assert!(law.step(&input(None, Some(goal))).is_none());
    assert_eq!(law.state(), before);
}

#[test]
fn zero_messages_count_as_not_received() {
    assert!(Measured::from_raw([0.0; 3], [0.0; 4], [0.0; 7], [0.0; 13]).is_none());
    assert!(Measured::from_raw([0.0; 3], [1.0, 0.0, 0.0, 0.0], [f64::NAN; 7], [0.0; 13]).is_none());
    assert!(Measured::from_raw([0.0; 3], [1.0, 0.0, 0.0, 0.0], [0.0; 7], [0.0; 13]).is_some());
}

#[test]
fn set_point_between_samples_is_propagated_or_held() {
    let measured = Plant::new(1.0, 1.0).measured();
    let mut set_point = Plant::new(1.0, 1.0).end_effector();
    set_point.velocity = Vector3::new(0.1, 0.0, -0.05);
    set_point.rate = Vector3::new(0.0, 0.2, 0.0);
    let error = |inter_sample| {
        let mut parameters = baseline();
        parameters.inter_sample = inter_sample;
        let mut law = HierarchicalLaw::new(model(), parameters).unwrap();
        let mut input = input(Some(measured), Some(set_point));
        input.set_point_age_s = 0.1;
        let telemetry = law.step(&input).unwrap().telemetry;
        (telemetry.position_error, telemetry.attitude_error.angle_rad())
    };
    let (position, angle) = error(InterSample::Propagate);
    assert!((position + Vector3::new(0.01, 0.0, -0.005)).norm() < 1e-12 && (angle - 0.02).abs() < 1e-12);
    let (position, angle) = error(InterSample::Hold);
    assert!(position.norm() < 1e-12 && angle < 1e-12);
}

#[test]
fn avoidance_moves_joints_without_moving_the_end_effector() {
    let mut parameters = baseline();
    parameters.avoidance = Some(AvoidanceParameters {
        lower_rad: [-2.0; 7],
        upper_rad: [2.0; 7],
        margin_rad: 0.7,
        rate_rad_s: 0.1,
        elbow: None,
    });
    let mut law = HierarchicalLaw::new(model(), parameters).unwrap();
    let measured = Plant::new(1.0, 1.0).measured();
    let telemetry = law.step(&input(Some(measured), None)).unwrap().telemetry;
    assert!(telemetry.avoidance[9] < -1e-4, "A4 at 80 degrees of 115 turns back");
    let twist = law.model().end_effector(&measured).jacobian * telemetry.virtual_velocity;
    assert!(twist.norm() < 1e-12);
}

#[test]
fn a_clamped_epsilon_is_reported_and_the_arm_rests() {
    let mut law = law();
    let mut measured = Plant::new(2.2, 1.0).measured();
    measured.velocity = Dof::zeros();
    let mut goal = Plant::new(2.2, 1.0).end_effector();
    goal.pose.position.x += 0.1;
    let telemetry = law.step(&input(Some(measured), Some(goal))).unwrap().telemetry;
    assert!(telemetry.epsilon_clamped && telemetry.epsilon == 0.0);
    assert_eq!(telemetry.virtual_velocity.fixed_rows::<7>(6).norm(), 0.0);
    assert!(telemetry.virtual_velocity[3].abs() > 0.05, "the base flies");
}

#[test]
fn out_of_range_parameters_are_rejected_with_remedy() {
    let refused = |change: fn(&mut hierarchical::Parameters)| {
        let mut parameters = baseline();
        change(&mut parameters);
        HierarchicalLaw::new(model(), parameters).unwrap_err()
    };
    let error = refused(|parameters| parameters.outer.position_gain.y = -1.0);
    assert_eq!(
        error.to_string(),
        "outer.position_gain = -1.0: must be a finite number above zero"
    );
    assert_eq!(refused(|p| p.tracker.period_s = 0.0).field, "period_s");
    assert_eq!(
        refused(|p| p.outer.weights.arm = ArmWeight::Fixed(-1.0)).field,
        "outer.weights.arm"
    );
    assert_eq!(refused(|p| p.tracker.filter.damping = f64::NAN).field, "filter.damping");
    let mut comparison = comparison::Parameters::new(tracker(0.01));
    comparison.least_squares_damping = 0.0;
    let error = ComparisonLaw::new(model(), comparison).unwrap_err();
    assert_eq!(error.field, "least_squares_damping");
}
