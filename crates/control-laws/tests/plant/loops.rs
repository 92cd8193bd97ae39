//! Guidance and law joined for the plant's loop.

use super::{KI, KP, LIMITS, NOMINAL, Plant, description, grasp};
use control_laws::filter::FilterParameters;
use control_laws::inner::{Bound, Discretisation, FeedbackLaw, Gains};
use control_laws::tracker::{TrackedVelocity, TrackerParameters};
use control_laws::{ComparisonLaw, ControlModel, Dof, HierarchicalLaw, ModelOptions, comparison, hierarchical};
use guidance_laws::Pose;
use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use guidance_laws::comparison::{self as comparison_guidance, BasePath, ComparisonGuidance};
use nalgebra::{UnitQuaternion, Vector3};

pub(crate) fn tracker(period_s: f64) -> TrackerParameters {
    TrackerParameters {
        period_s,
        filter: FilterParameters::default(),
        followed: TrackedVelocity::Raw,
        gains: Gains::diagonal(&Dof::from(KP), &Dof::from(KI)),
        feedback: FeedbackLaw::ConditionalIntegrator {
            bound: Bound::PerChannel(Dof::from(LIMITS)),
            discretisation: Discretisation::Exact,
        },
    }
}

/// The baseline of the hierarchical law at 10 ms.
pub(crate) fn baseline() -> hierarchical::Parameters {
    hierarchical::Parameters::new(tracker(0.01))
}

pub(crate) fn model() -> ControlModel {
    ControlModel::new(&description(), &ModelOptions::default()).unwrap()
}

/// The capture guidance and a hierarchical law, each at every sample of the controller.
pub(crate) fn hierarchical_loop(
    mut law: HierarchicalLaw,
    schedule: Schedule,
) -> impl FnMut(f64, &Plant) -> hierarchical::Output {
    let mut guidance = CaptureGuidance::new(capture::Parameters {
        schedule,
        grasp: grasp(),
    })
    .unwrap();
    move |time_s, plant| {
        let measured = plant.measured();
        let set_point = guidance
            .step(&capture::Input {
                time_s,
                end_effector: Some(law.model().end_effector(&measured).pose),
                target: Some(plant.target),
            })
            .set_point;
        law.step(&hierarchical::Input {
            measured: Some(measured),
            set_point,
            set_point_age_s: 0.0,
            wheel_momentum: Vector3::zeros(),
        })
        .expect("there is a measurement")
    }
}

/// The comparison guidance with its fixed instants and the comparison law.
pub(crate) fn comparison_loop(base_path: BasePath) -> impl FnMut(f64, &Plant) -> comparison::Output {
    let mut guidance = ComparisonGuidance::new(comparison_guidance::Parameters {
        schedule: Schedule::CLOSE,
        grasp: grasp(),
        closing_pose: Pose {
            position: NOMINAL.into(),
            attitude: UnitQuaternion::identity(),
        },
        base_path,
    })
    .unwrap();
    let mut law = ComparisonLaw::new(model(), comparison::Parameters::new(tracker(0.01))).unwrap();
    move |time_s, plant| {
        let measured = plant.measured();
        let set_points = guidance.step(&comparison_guidance::Input {
            time_s,
            base: Some(measured.base),
            end_effector: Some(law.model().end_effector(&measured).pose),
            target: Some(plant.target),
        });
        law.step(&comparison::Input {
            measured: Some(measured),
            end_effector: set_points.end_effector.set_point,
            base: set_points.base,
            set_point_age_s: 0.0,
            wheel_momentum: Vector3::zeros(),
        })
        .expect("there is a measurement")
    }
}
