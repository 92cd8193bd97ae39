//! No law allocates between its first and its last step.

mod plant;

use control_laws::inner::Gains;
use control_laws::stabilise::{self, StabilisingLaw};
use control_laws::{Dof, HierarchicalLaw, Matrix13, ModelOptions, ReferenceLaw, hierarchical, reference};
use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use nalgebra::Vector3;
use plant::loops::{baseline, model, tracker};
use plant::{LIMITS, Plant, grasp};
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
fn a_step_of_any_law_allocates_nothing() {
    assert!(
        allocations(|| drop(std::hint::black_box(Box::new(1)))) > 0,
        "the counter counts"
    );
    let plant = Plant::new(1.2, 1.0);
    let (measured, target) = (plant.measured(), plant.target);
    let mut guidance = CaptureGuidance::new(capture::Parameters {
        schedule: Schedule::CLOSE,
        grasp: grasp(),
    })
    .unwrap();
    let mut hierarchical = HierarchicalLaw::new(model(), baseline()).unwrap();
    let mut scheduled = baseline();
    let ki = *scheduled.tracker.gains.ki();
    scheduled.tracker.gains = Gains::scheduled(Matrix13::identity() * 5.0, &ki.diagonal());
    let mut scheduled = HierarchicalLaw::new(model(), scheduled).unwrap();
    let mut comparison = ReferenceLaw::new(model(), reference::Parameters::new(tracker(0.01))).unwrap();
    let limits = Dof::from(LIMITS);
    let stabilising = stabilise::Parameters {
        rotation_1_s: 0.2,
        translation_1_s: 0.2,
        joints_1_s: 0.2,
        limits,
        gripper_force_n: 3.0,
        gripper_torque_nm: 2.0,
        wheel_momentum_nms: Vector3::repeat(12.0),
        rest_rate_rad_s: 1e-4,
        rest_speed_m_s: 1e-4,
        allocation: None,
    };
    let stack = control_laws::ControlModel::new(&plant::description(), &ModelOptions::default()).unwrap();
    let mut stabilising = StabilisingLaw::new(stack, model(), stabilising).unwrap();
    let count = allocations(|| {
        for tick in 0..100 {
            let time_s = 0.3 * f64::from(tick);
            let set_point = guidance
                .step(&capture::Input {
                    time_s,
                    end_effector: Some(hierarchical.model().end_effector(&measured).pose),
                    target: Some(target),
                })
                .set_point;
            for law in [&mut hierarchical, &mut scheduled] {
                law.step(&hierarchical::Input {
                    measured: Some(measured),
                    set_point,
                    set_point_age_s: 0.0,
                    wheel_momentum: Vector3::zeros(),
                });
            }
            comparison.step(&reference::Input {
                measured: Some(measured),
                end_effector: set_point,
                base: None,
                set_point_age_s: 0.0,
                wheel_momentum: Vector3::zeros(),
            });
            stabilising.step(&stabilise::Input {
                time_s,
                measured: Some(measured),
                wheel_momentum: Vector3::zeros(),
            });
        }
    });
    assert_eq!(count, 0);
}
