//! The captures, closed in one loop, against the figures of an independent simulation of the same baseline.

mod plant;

use control_laws::filter::FilterParameters;
use control_laws::hierarchical::{self, HierarchicalLaw};
use control_laws::inner::{Bound, Discretisation, FeedbackLaw, Gains};
use control_laws::outer::OuterParameters;
use control_laws::tracker::{Followed, TrackerParameters};
use control_laws::{ControlModel, Dof, ModelOptions};
use guidance_laws::Between;
use guidance_laws::capture::{self, CaptureGuidance, Schedule};
use nalgebra::Vector3;
use plant::{Figures, KI, KP, LIMITS, Plant, description, grasp, run};

fn tracker(period_s: f64) -> TrackerParameters {
    TrackerParameters {
        period_s,
        filter: FilterParameters::default(),
        followed: Followed::Raw,
        gains: Gains::diagonal(&Dof::from(KP), &Dof::from(KI)),
        feedback: FeedbackLaw::ConditionalIntegrator {
            bound: Bound::PerChannel(Dof::from(LIMITS)),
            discretisation: Discretisation::Exact,
        },
    }
}

fn parameters(period_s: f64) -> hierarchical::Parameters {
    hierarchical::Parameters {
        outer: OuterParameters::default(),
        tracker: tracker(period_s),
        between: Between::Propagate,
        avoidance: None,
        allocation: None,
    }
}

fn model() -> ControlModel {
    ControlModel::new(&description(), &ModelOptions::default()).unwrap()
}

/// Guidance and hierarchical law together, each at every controller sample.
fn hierarchical(parameters: hierarchical::Parameters, schedule: Schedule) -> impl FnMut(f64, &Plant) -> Dof {
    let mut guidance = CaptureGuidance::new(capture::Parameters {
        schedule,
        grasp: grasp(),
    })
    .unwrap();
    let mut law = HierarchicalLaw::new(model(), parameters).unwrap();
    move |time_s, plant| {
        let measured = plant.measured();
        let set_point = guidance
            .step(&capture::Input {
                time_s,
                end_effector: Some(law.model().end_effector(&measured).pose),
                target: Some(plant.target),
            })
            .set_point;
        let output = law.step(&hierarchical::Input {
            measured: Some(measured),
            set_point,
            set_point_age_s: 0.0,
            wheel_momentum: Vector3::zeros(),
        });
        output.unwrap().force
    }
}

fn close(parameters: hierarchical::Parameters) -> (Figures, Plant) {
    let period_s = parameters.tracker.period_s;
    let law = hierarchical(parameters, Schedule::CLOSE);
    run(Plant::new(1.2, 1.0), 35.0, 30.0, period_s, law)
}

#[test]
fn close_capture_agrees_with_the_independent_simulation() {
    let (figures, plant) = close(parameters(0.01));
    println!("{figures:#?}\n{:?}", plant.state);
    // 0.10 mm, 0.002 deg, 0.074 N m and 0.92 N, to the digits given
    assert!((figures.position_error_m - 1.0e-4).abs() < 0.05e-4);
    assert!((figures.attitude_error_deg - 0.002).abs() < 0.0005);
    assert!((figures.peak_torque_nm - 0.074).abs() < 0.0005);
    assert!((figures.peak_force_n - 0.92).abs() < 0.005);
    assert_eq!(figures.saturated, 0.0);
}

#[test]
fn far_capture_is_captured() {
    let law = hierarchical(parameters(0.01), Schedule::FAR);
    let (figures, _) = run(Plant::new(2.0, 1.0), 60.0, 55.0, 0.01, law);
    println!("{figures:#?}");
    assert!(figures.position_error_m < 5e-3);
    assert!(figures.attitude_error_deg < 0.5);
}
