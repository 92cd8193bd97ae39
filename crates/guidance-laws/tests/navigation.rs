//! The navigation filter against simulated cameras: consistency, accuracy better than the camera's, and correct latency prediction.

use guidance_laws::navigation::{CameraPose, NavigationFilter, Parameters, PositionAttitude, Update};
use guidance_laws::target::TargetModel;
use guidance_laws::{Pose, TargetState, so3};
use nalgebra::{Matrix3, SVector, Vector3};
use testing::random::SplitMix;

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const CAMERA_PERIOD_S: f64 = 0.1;
const LATENCY_S: f64 = 0.1;

/// 3 mm and 0.2 degrees with a time constant of 5 s: the camera of the baseline.
fn parameters() -> Parameters {
    Parameters {
        target: TargetModel::new(Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)), 0.01).unwrap(),
        drift_sigma: PositionAttitude {
            position: 0.003,
            attitude: 0.2 * DEGREE,
        },
        drift_time_s: 5.0,
        white_sigma: PositionAttitude {
            position: 1e-4,
            attitude: 1e-4,
        },
        acceleration_density: PositionAttitude {
            position: 1e-7,
            attitude: 1e-7,
        },
        initial_rate_sigma: PositionAttitude {
            position: 0.02,
            attitude: 0.03,
        },
        gate: f64::INFINITY,
        rejections_max: 5,
    }
}

/// Numbers from a normal distribution, by Box and Muller.
struct Normal(SplitMix);

impl Normal {
    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            let (a, b) = self.0.pair();
            sigma * (-2.0 * libm::log(a)).sqrt() * libm::cos(std::f64::consts::TAU * b)
        })
    }
}

/// A camera with slow and white errors, as modelled by the filter.
struct Camera {
    normal: Normal,
    position_drift: Vector3<f64>,
    attitude_drift: Vector3<f64>,
}

impl Camera {
    fn new(parameters: &Parameters, seed: u64) -> Self {
        let mut normal = Normal(SplitMix(seed));
        Self {
            position_drift: normal.vector(parameters.drift_sigma.position),
            attitude_drift: normal.vector(parameters.drift_sigma.attitude),
            normal,
        }
    }

    fn measure(&mut self, parameters: &Parameters, stamp_s: f64, truth: &TargetState) -> CameraPose {
        let keep = libm::exp(-CAMERA_PERIOD_S / parameters.drift_time_s);
        let fresh = (1.0 - keep * keep).sqrt();
        let position = self.position_drift + self.normal.vector(parameters.white_sigma.position);
        let attitude = self.attitude_drift + self.normal.vector(parameters.white_sigma.attitude);
        self.position_drift = self.position_drift * keep + self.normal.vector(parameters.drift_sigma.position * fresh);
        self.attitude_drift = self.attitude_drift * keep + self.normal.vector(parameters.drift_sigma.attitude * fresh);
        CameraPose {
            stamp_s,
            pose: Pose {
                position: truth.pose.position + position,
                attitude: truth.pose.attitude * so3::exp(&attitude),
            },
        }
    }
}

/// A target with velocities drawn from the filter's prior.
fn random_target(parameters: &Parameters, seed: u64) -> TargetState {
    let mut normal = Normal(SplitMix(seed ^ 0xabcd));
    TargetState {
        pose: Pose {
            position: Vector3::new(0.1, -0.2, 0.3),
            attitude: so3::exp(&normal.vector(1.0)),
        },
        velocity: normal.vector(parameters.initial_rate_sigma.position),
        rate: normal.vector(parameters.initial_rate_sigma.attitude),
    }
}

struct Run {
    /// Normalised estimation error squared of position, velocity, attitude and rate at the last stamp.
    nees: f64,
    /// Mean normalised innovation squared.
    nis: f64,
    position_error_m: f64,
    attitude_error_rad: f64,
}

/// `parameters` describes the simulated world, `assumed` the filter's model of it.
fn run(parameters: &Parameters, assumed: &Parameters, seed: u64, duration_s: f64) -> Run {
    let start = random_target(parameters, seed);
    let mut camera = Camera::new(parameters, seed);
    let mut filter = NavigationFilter::new(*assumed).unwrap();
    let (mut truth, mut stamp_s) = (start, 0.0);
    let (mut nis_sum, mut nis_count) = (0.0, 0.0);
    let measurements = (duration_s / CAMERA_PERIOD_S) as u32;
    for number in 0..=measurements {
        stamp_s = f64::from(number) * CAMERA_PERIOD_S;
        truth = parameters.target.predicted(&start, stamp_s);
        let measurement = camera.measure(parameters, stamp_s, &truth);
        // evaluated at the pose's own stamp, so that covariance and estimate refer to the same time
        let estimate = filter.step(stamp_s, Some(&measurement)).unwrap();
        if let Update::Accepted { nis } = estimate.update {
            nis_sum += nis;
            nis_count += 1.0;
        }
    }
    let estimate = filter.step(stamp_s, None).unwrap().target;
    let error = SVector::<f64, 12>::from_iterator(
        (truth.pose.position - estimate.pose.position)
            .iter()
            .chain((truth.velocity - estimate.velocity).iter())
            .chain(so3::log(&(estimate.pose.attitude.inverse() * truth.pose.attitude)).iter())
            .chain((truth.rate - estimate.rate).iter())
            .copied(),
    );
    let covariance = filter.covariance().unwrap().fixed_view::<12, 12>(0, 0).into_owned();
    Run {
        nees: error.dot(&covariance.cholesky().expect("a covariance").solve(&error)),
        nis: nis_sum / nis_count,
        position_error_m: error.fixed_rows::<3>(0).norm(),
        attitude_error_rad: error.fixed_rows::<3>(6).norm(),
    }
}

#[test]
fn filter_errors_are_consistent_with_its_covariance() {
    let parameters = parameters();
    let runs: Vec<Run> = (0..200).map(|seed| run(&parameters, &parameters, seed, 20.0)).collect();
    let mean = |figure: fn(&Run) -> f64| runs.iter().map(figure).sum::<f64>() / 200.0;
    // chi-square with 12 degrees of freedom over 200 runs: mean 12, standard deviation √(24/200) = 0.35; four of them
    let nees = mean(|run| run.nees);
    assert!((nees - 12.0).abs() < 1.4, "{nees}");
    // innovations of one run are white: 200 runs of 200 pictures, mean 6, standard deviation √(12/40000) = 0.017; four of them
    let nis = mean(|run| run.nis);
    assert!((nis - 6.0).abs() < 0.07, "{nis}");
    // the target's own motion averages the camera's slow errors: better than the camera, whose mean length is 1.596 sigma
    let camera = 2.0 * (2.0 / std::f64::consts::PI).sqrt();
    assert!(mean(|run| run.position_error_m) < camera * parameters.drift_sigma.position);
    assert!(mean(|run| run.attitude_error_rad) < camera * parameters.drift_sigma.attitude);
}

#[test]
fn filter_without_drift_model_is_overconfident() {
    let parameters = parameters();
    let assumed = Parameters {
        drift_sigma: PositionAttitude {
            position: 0.0,
            attitude: 0.0,
        },
        white_sigma: parameters.drift_sigma,
        ..parameters
    };
    let nees = (0..50)
        .map(|seed| run(&parameters, &assumed, seed, 20.0).nees)
        .sum::<f64>()
        / 50.0;
    println!("{nees}");
    assert!(nees > 10.0 * 12.0, "{nees}");
}

#[test]
fn estimate_predicts_over_the_latency() {
    let parameters = parameters();
    let start = random_target(&parameters, 7);
    let mut filter = NavigationFilter::new(parameters).unwrap();
    let mut last = None;
    for tick in 0..2000 {
        let time_s = 0.01 * f64::from(tick);
        // a camera without errors but with latency; the newest pose that has arrived is offered repeatedly
        let arrived = ((time_s - LATENCY_S + 1e-9) / CAMERA_PERIOD_S).floor();
        let measurement = (arrived >= 0.0).then(|| {
            let stamp_s = arrived * CAMERA_PERIOD_S;
            CameraPose {
                stamp_s,
                pose: parameters.target.predicted(&start, stamp_s).pose,
            }
        });
        last = filter.step(time_s, measurement.as_ref());
        assert_eq!(last.is_some(), time_s > LATENCY_S - 1e-6);
        if let Some(estimate) = last {
            assert!(estimate.age_s > LATENCY_S - 1e-9 && estimate.age_s < LATENCY_S + CAMERA_PERIOD_S);
        }
    }
    let (truth, estimate) = (parameters.target.predicted(&start, 19.99), last.unwrap().target);
    assert!((truth.pose.position - estimate.pose.position).norm() < 1e-4);
    assert!(truth.pose.attitude.angle_to(&estimate.pose.attitude) < 1e-4);
    assert!((truth.rate - estimate.rate).norm() < 1e-4);
    // without prediction over the latency the attitude alone would be off by ten times that
    assert!(truth.rate.norm() * LATENCY_S > 1e-3);
}

#[test]
fn gated_pose_is_rejected_and_many_reinitialise_the_filter() {
    let gated = Parameters {
        gate: 40.0,
        ..parameters()
    };
    let start = random_target(&gated, 3);
    let mut filter = NavigationFilter::new(gated).unwrap();
    let mut camera = Camera::new(&gated, 3);
    for number in 0..100 {
        let stamp_s = 0.1 * f64::from(number);
        let measurement = camera.measure(&gated, stamp_s, &gated.target.predicted(&start, stamp_s));
        filter.step(stamp_s, Some(&measurement));
    }
    let before = filter.clone();
    let mut outlier = camera.measure(&gated, 10.0, &gated.target.predicted(&start, 10.0));
    outlier.pose.position.x += 0.5;
    assert!(matches!(filter.step(10.0, Some(&outlier)).unwrap().update, Update::Rejected { nis } if nis > 1e3));
    let moved = filter.step(10.0, None).unwrap().target.pose.position
        - before.clone().step(10.0, None).unwrap().target.pose.position;
    assert!(moved.norm() < 1e-12, "a refused pose moves nothing");
    for number in 1..=5 {
        outlier.stamp_s = 10.0 + 0.1 * f64::from(number);
        let update = filter.step(outlier.stamp_s, Some(&outlier)).unwrap().update;
        assert_eq!(update == Update::Started, number == 5, "{number}: {update:?}");
    }
}

#[test]
fn pose_is_processed_once_and_older_poses_never() {
    let parameters = parameters();
    let start = random_target(&parameters, 5);
    let mut camera = Camera::new(&parameters, 5);
    let mut filter = NavigationFilter::new(parameters).unwrap();
    assert!(filter.step(0.0, None).is_none());
    let first = camera.measure(&parameters, 0.0, &start);
    let second = camera.measure(&parameters, 0.1, &parameters.target.predicted(&start, 0.1));
    assert_eq!(filter.step(0.1, Some(&first)).unwrap().update, Update::Started);
    assert!(matches!(
        filter.step(0.2, Some(&second)).unwrap().update,
        Update::Accepted { .. }
    ));
    let state = filter.state();
    for camera in [first, second] {
        assert_eq!(filter.step(0.25, Some(&camera)).unwrap().update, Update::None);
    }
    assert_eq!(filter.state(), state);
}

#[test]
fn a_restored_filter_continues_with_the_same_bits() {
    let parameters = parameters();
    let start = random_target(&parameters, 11);
    let mut camera = Camera::new(&parameters, 11);
    let mut whole = NavigationFilter::new(parameters).unwrap();
    let mut part = NavigationFilter::from_state(parameters, &whole.state()).unwrap();
    for number in 0..60 {
        let stamp_s = 0.1 * f64::from(number);
        let measurement = camera.measure(&parameters, stamp_s, &parameters.target.predicted(&start, stamp_s));
        assert_eq!(
            whole.step(stamp_s + 0.1, Some(&measurement)),
            part.step(stamp_s + 0.1, Some(&measurement))
        );
        part = NavigationFilter::from_state(parameters, &part.state()).unwrap();
    }
}

#[test]
fn parameters_out_of_range_are_refused_with_the_field() {
    let mut wrong = parameters();
    wrong.white_sigma.attitude = 0.0;
    assert_eq!(NavigationFilter::new(wrong).unwrap_err().field, "white_sigma");
    let wrong = Parameters {
        gate: f64::NAN,
        ..parameters()
    };
    assert_eq!(NavigationFilter::new(wrong).unwrap_err().field, "gate");
    let wrong = Parameters {
        drift_time_s: 0.0,
        ..parameters()
    };
    assert_eq!(NavigationFilter::new(wrong).unwrap_err().field, "drift_time_s");
}
