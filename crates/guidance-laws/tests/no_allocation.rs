//! Neither guidance nor navigation allocates between its first and its last step.

use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use guidance_laws::comparison::{self, BasePath, ComparisonGuidance};
use guidance_laws::navigation::{self, CameraPose, NavigationFilter, PositionAttitude};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, TargetState, so3};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use testing::allocation::{Counting, allocations_during};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnMut()) -> u64 {
    allocations_during(work).count
}

#[test]
fn a_step_allocates_nothing() {
    let pose = Pose {
        position: Vector3::new(-0.35, 0.0, -2.375),
        attitude: UnitQuaternion::identity(),
    };
    let inertia = Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0));
    let model = TargetModel::new(inertia, 0.01).unwrap();
    let start = TargetState {
        pose: Pose {
            position: Vector3::zeros(),
            attitude: so3::exp(&Vector3::new(0.1, 0.2, 0.3)),
        },
        velocity: Vector3::zeros(),
        rate: Vector3::new(0.005, 0.009, 0.017),
    };
    let mut capture = CaptureGuidance::new(capture::Parameters {
        schedule: Schedule::CLOSE,
        grasp: pose,
    })
    .unwrap();
    let mut comparison = ComparisonGuidance::new(comparison::Parameters {
        schedule: Schedule::CLOSE,
        grasp: pose,
        closing_pose: pose,
        base_path: BasePath::Replanned,
    })
    .unwrap();
    let pair = |position, attitude| PositionAttitude { position, attitude };
    let mut filter = NavigationFilter::new(navigation::Parameters {
        target: model,
        drift_sigma: pair(0.003, 0.0035),
        drift_time_s: 5.0,
        white_sigma: pair(0.003, 0.0035),
        acceleration_density: pair(1e-6, 1e-6),
        initial_rate_sigma: pair(0.01, 0.05),
        gate: 22.5,
        rejections_max: 10,
    })
    .unwrap();
    let count = allocations(|| {
        for tick in 0..300 {
            let time_s = 0.1 * f64::from(tick);
            let picture = CameraPose {
                stamp_s: time_s,
                pose: model.predicted(&start, time_s).pose,
            };
            let target = filter
                .step(time_s + 0.1, Some(&picture))
                .map(|estimate| estimate.target);
            capture.step(&capture::Input {
                time_s,
                end_effector: Some(pose),
                target,
            });
            comparison.step(&comparison::Input {
                time_s,
                base: Some(pose),
                end_effector: Some(pose),
                target,
            });
        }
    });
    assert_eq!(count, 0);
}
