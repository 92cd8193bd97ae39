//! Neither guidance nor navigation allocates between its first and its last step.

use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use guidance_laws::navigation::{self, CameraPose, NavigationFilter, PositionAttitude};
use guidance_laws::reference::{self, BasePath, ReferenceGuidance};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, TargetState, so3};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches a thread-local without a destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's obligations are those of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `System`, with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(mut work: impl FnMut()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn a_step_allocates_nothing() {
    assert!(
        allocations(|| drop(std::hint::black_box(Box::new(1)))) > 0,
        "the counter counts"
    );
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
    let mut reference = ReferenceGuidance::new(reference::Parameters {
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
        refusals_max: 10,
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
            reference.step(&reference::Input {
                time_s,
                base: Some(pose),
                end_effector: Some(pose),
                target,
            });
        }
    });
    assert_eq!(count, 0);
}
