//! No law allocates between its first and its last step.

mod plant;

use control_laws::inner::{Bound, Discretisation, FeedbackLaw, Gains, InnerLoop};
use control_laws::stabilise::{self, StabilisingLaw};
use control_laws::{ComparisonLaw, Dof, HierarchicalLaw, Matrix13, ModelOptions, comparison, hierarchical};
use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use nalgebra::Vector3;
use plant::loops::{baseline, model, tracker};
use plant::{LIMITS, Plant, grasp};
use testing::allocation::{Counting, allocations_during};
use testing::random::SplitMix;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(work: impl FnMut()) -> u64 {
    allocations_during(work).count
}

#[test]
fn a_step_of_any_law_allocates_nothing() {
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
    let mut comparison = ComparisonLaw::new(model(), comparison::Parameters::new(tracker(0.01))).unwrap();
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
            comparison.step(&comparison::Input {
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

/// Whether the fixed-point iteration of the saturated step, which the inner loop tries first, converges within `rounds`.
fn fixed_point_converges(kp: &Matrix13, ki: &Matrix13, period_s: f64, sigma: &Dof, error: &Dof, bound: f64) -> bool {
    let drive = kp.try_inverse().unwrap() * period_s;
    let carry = (Matrix13::identity() + drive * ki).try_inverse().unwrap();
    let mut next = *sigma;
    (0..200).any(|_| {
        let force = (ki * next + kp * error).map(|value| value.clamp(-bound, bound));
        let candidate = carry * (sigma + drive * force);
        let settled = (candidate - next).amax() <= 4.0 * f64::EPSILON * candidate.amax();
        next = candidate;
        settled
    })
}

/// Unrelated gains: the fixed-point iteration of the implicit step diverges, and pivoting solves it.
#[test]
fn pivoting_allocates_nothing() {
    const BOUND: f64 = 1.0;
    const PERIOD_S: f64 = 0.5;
    let mut random = SplitMix(7);
    let factor = Matrix13::from_fn(|_, _| 2.0 * random.uniform() - 1.0);
    let kp = factor * factor.transpose() + Matrix13::identity() * 0.01;
    let ki = Matrix13::from_diagonal(&Dof::from_fn(|_, _| libm::pow(10.0, 9.0 * random.uniform() - 3.0)));
    let law = FeedbackLaw::ConditionalIntegrator {
        bound: Bound::Scalar(BOUND),
        discretisation: Discretisation::Exact,
    };
    let mut inner = InnerLoop::new(Gains::full(kp, ki), &law, PERIOD_S).unwrap();
    let errors: [Dof; 200] = std::array::from_fn(|step| {
        let size = [0.01, 0.1, 1.0, 10.0][step % 4];
        Dof::from_fn(|_, _| size * (2.0 * random.uniform() - 1.0))
    });
    let mut pivoted = 0;
    for error in &errors {
        let before = *inner.sigma();
        let mut feedback = None;
        let count = allocations(|| feedback = Some(inner.step(error)));
        assert_eq!(count, 0);
        assert!(feedback.is_some_and(|feedback| feedback.converged));
        pivoted += usize::from(!fixed_point_converges(&kp, &ki, PERIOD_S, &before, error, BOUND));
    }
    assert!(pivoted > 0, "the fixed point settled in every step");
}
