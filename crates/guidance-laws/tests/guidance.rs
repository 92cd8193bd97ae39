//! The capture and the comparison guidance: exact velocities, phases, ends, and continuation from a snapshot.

use guidance_laws::capture::{self, CaptureGuidance, Phase, Schedule};
use guidance_laws::comparison::{self, BasePath, ComparisonGuidance};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, SetPoint, TargetState, so3};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;

fn grasp() -> Pose {
    Pose {
        position: Vector3::new(0.05, 0.0, -0.65),
        attitude: so3::exp(&Vector3::new(0.2, 0.1, -0.3)),
    }
}

fn start_pose() -> Pose {
    Pose {
        position: Vector3::new(-0.42, 0.1, -1.9),
        attitude: so3::exp(&Vector3::new(-0.4, 0.7, 0.2)),
    }
}

fn target_at(time_s: f64, rate: Vector3<f64>) -> TargetState {
    let model = TargetModel::new(Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)), 0.01).unwrap();
    let start = TargetState {
        pose: Pose {
            position: Vector3::new(0.01, -0.02, 0.03),
            attitude: UnitQuaternion::identity(),
        },
        velocity: Vector3::new(1e-3, -2e-3, 5e-4),
        rate,
    };
    model.predicted(&start, time_s)
}

fn baseline_rate() -> Vector3<f64> {
    Vector3::new(0.3, 0.5, 1.0) * std::f64::consts::PI / 180.0
}

fn guidance() -> CaptureGuidance {
    CaptureGuidance::new(capture::Parameters {
        schedule: Schedule::CLOSE,
        grasp: grasp(),
    })
    .unwrap()
}

fn input(time_s: f64, rate: Vector3<f64>) -> capture::Input {
    capture::Input {
        time_s,
        end_effector: Some(start_pose()),
        target: Some(target_at(time_s, rate)),
    }
}

/// Largest difference between the velocities of `set_point` and the central differences of its poses: m/s and rad/s.
fn velocity_mismatch(set_point: impl Fn(f64) -> SetPoint, time_s: f64) -> f64 {
    let step_s = 1e-4;
    let [before, now, after] = [-step_s, 0.0, step_s].map(|offset| set_point(time_s + offset));
    let velocity = (after.pose.position - before.pose.position) / (2.0 * step_s);
    let rate = so3::log(&(before.pose.attitude.inverse() * after.pose.attitude)) / (2.0 * step_s);
    (velocity - now.velocity).norm().max((rate - now.rate).norm())
}

#[test]
fn velocities_are_the_derivatives_of_the_poses() {
    // also six times the baseline tumble: then the axis of the relative rotation turns during the approach
    for factor in [1.0, 2.0, 6.0] {
        let rate = baseline_rate() * factor;
        let mut law = guidance();
        law.step(&input(0.0, rate));
        let mut worst = 0.0_f64;
        for tick in 1..350 {
            let time_s = 0.1 * f64::from(tick) + 0.013;
            law.step(&input(time_s, rate));
            let at = |time_s: f64| law.clone().step(&input(time_s, rate)).set_point.unwrap();
            worst = worst.max(velocity_mismatch(at, time_s));
        }
        assert!(worst < 2e-8, "tumble × {factor}: {worst}");
    }
}

#[test]
fn set_point_holds_the_start_and_ends_on_the_grasp_frame() {
    let mut law = guidance();
    let first = law.step(&input(0.0, baseline_rate()));
    assert_eq!(first.phase, Phase::Waiting);
    assert!((first.set_point.unwrap().pose.position - start_pose().position).norm() < 1e-15);
    assert!(first.set_point.unwrap().pose.attitude.angle_to(&start_pose().attitude) < 1e-15);
    assert_eq!(
        first.set_point.unwrap().velocity.norm() + first.set_point.unwrap().rate.norm(),
        0.0
    );
    for (time_s, phase) in [
        (0.99, Phase::Waiting),
        (1.0, Phase::Pointing),
        (20.0, Phase::Closing),
        (30.0, Phase::Tracking),
    ] {
        assert_eq!(law.step(&input(time_s, baseline_rate())).phase, phase, "{time_s}");
    }
    for time_s in [30.0, 33.0, 100.0] {
        let set_point = law.step(&input(time_s, baseline_rate())).set_point.unwrap();
        assert_eq!(
            set_point,
            target_at(time_s, baseline_rate()).frame(&grasp()),
            "to the last bit"
        );
    }
    let pointed = law.step(&input(20.0, baseline_rate())).set_point.unwrap();
    let frame = target_at(20.0, baseline_rate()).frame(&grasp());
    assert_eq!((pointed.pose.attitude, pointed.rate), (frame.pose.attitude, frame.rate));
    assert!(
        (pointed.pose.position - frame.pose.position).norm() > 0.1,
        "the position still closes in"
    );
}

#[test]
fn missing_measurement_gives_no_set_point_no_target_no_motion() {
    let mut law = guidance();
    let nothing = capture::Input {
        time_s: 0.0,
        end_effector: None,
        target: Some(target_at(0.0, baseline_rate())),
    };
    assert!(law.step(&nothing).set_point.is_none());
    let blind = capture::Input {
        time_s: 5.0,
        end_effector: Some(start_pose()),
        target: None,
    };
    assert_eq!(law.step(&blind).set_point.unwrap(), SetPoint::at_rest(start_pose()));
}

#[test]
fn the_start_pose_is_the_first_one_received() {
    let mut law = guidance();
    law.step(&input(0.0, baseline_rate()));
    let mut moved = input(0.5, baseline_rate());
    moved.end_effector = Some(grasp());
    assert_eq!(law.step(&moved).set_point.unwrap().pose.position, start_pose().position);
}

#[test]
fn relative_rotation_beyond_half_a_turn_has_no_jump() {
    // 0.2 rad/s for 19 s is 3.8 rad
    let rate = Vector3::new(0.0, 0.02, 0.2);
    let mut law = guidance();
    let mut previous = law.step(&input(0.0, rate)).set_point.unwrap();
    for tick in 1..2500 {
        let now = law.step(&input(0.01 * f64::from(tick), rate)).set_point.unwrap();
        assert!(
            previous.pose.attitude.angle_to(&now.pose.attitude) < 6e-3,
            "tick {tick}"
        );
        previous = now;
    }
}

#[test]
fn instants_out_of_order_are_refused_with_the_field() {
    let with = |start_s, point_s, grasp_s| {
        let schedule = Schedule {
            start_s,
            point_s,
            grasp_s,
        };
        CaptureGuidance::new(capture::Parameters {
            schedule,
            grasp: grasp(),
        })
        .map(drop)
        .map_err(|error| error.field)
    };
    assert_eq!(with(1.0, 1.0, 30.0), Err("schedule.point_s"));
    assert_eq!(with(1.0, 20.0, 19.0), Err("schedule.grasp_s"));
    assert_eq!(with(f64::NAN, 20.0, 30.0), Err("schedule.start_s"));
    assert_eq!(with(1.0, 20.0, 20.0), Ok(()));
}

fn comparison(base_path: BasePath) -> ComparisonGuidance {
    ComparisonGuidance::new(comparison::Parameters {
        schedule: Schedule::CLOSE,
        grasp: grasp(),
        closing_pose: Pose {
            position: Vector3::new(-0.35, 0.0, -2.375),
            attitude: UnitQuaternion::identity(),
        },
        base_path,
    })
    .unwrap()
}

fn comparison_input(time_s: f64) -> comparison::Input {
    comparison::Input {
        time_s,
        base: Some(Pose {
            position: Vector3::new(-0.42, 0.0, -2.85),
            attitude: so3::exp(&Vector3::new(0.1, 0.0, 0.05)),
        }),
        end_effector: Some(start_pose()),
        target: Some(target_at(time_s, baseline_rate())),
    }
}

#[test]
fn the_comparison_base_path_is_a_step_or_a_quintic() {
    let mut tied = comparison(BasePath::NominalPose);
    let mut replanned = comparison(BasePath::Replanned);
    let closing = tied.parameters().closing_pose;
    for tick in 0..400 {
        let time_s = 0.1 * f64::from(tick);
        let input = comparison_input(time_s);
        let expected = if time_s < 1.0 { input.base.unwrap() } else { closing };
        assert_eq!(tied.step(&input).base.unwrap(), SetPoint::at_rest(expected));
        replanned.step(&input);
        let at = |time_s| replanned.clone().step(&comparison_input(time_s)).base.unwrap();
        assert!(velocity_mismatch(at, time_s) < 1e-9, "{time_s}");
    }
    let start = comparison_input(0.0).base.unwrap();
    assert!((replanned.step(&comparison_input(0.5)).base.unwrap().pose.position - start.position).norm() < 1e-15);
    assert!((replanned.step(&comparison_input(20.0)).base.unwrap().pose.position - closing.position).norm() < 1e-15);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn a_restored_law_continues_with_the_same_bits(split in 1_usize..60, x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0) {
        let rate = Vector3::new(x, y, z) * 0.1;
        let mut whole = comparison(BasePath::Replanned);
        let mut first = whole;
        let at = |tick: usize| {
            let mut input = comparison_input(0.5 * tick as f64);
            input.target = Some(target_at(input.time_s, rate));
            input
        };
        for tick in 0..split {
            whole.step(&at(tick));
            first.step(&at(tick));
        }
        let mut second = ComparisonGuidance::from_state(*whole.parameters(), &first.state()).unwrap();
        prop_assert_eq!(second, whole);
        for tick in split..split + 20 {
            prop_assert_eq!(second.step(&at(tick)), whole.step(&at(tick)));
        }
    }
}
