//! The velocity loop of the stock servicer: linearisation, sampled loop in closed form, margins, and the shipped files.

use synthesis::linalg::{Matrix, diagonal, inverse, max_abs, norm2};
use synthesis::mu::{MarginOptions, margin};
use synthesis::robot::{
    GainStructure, Gains, GainsFile, ModelSpec, Robot, RobotError, Spec, multiplicative_loop, problem, report, sampled,
};

const URDF: &str = include_str!("../../../models/servicer.urdf");
const PI: &str = include_str!("../../../gains/pi-diagonal.spec.toml");

fn close(found: f64, expected: f64, relative: f64) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "found {found:.10}, expected {expected:.10}"
    );
}

fn stock() -> (Spec, Robot) {
    let spec: Spec = toml::from_str(PI).unwrap();
    let robot = Robot::new(URDF, &spec.robot).unwrap();
    (spec, robot)
}

fn capture() -> ModelSpec {
    ModelSpec::nominal(vec![0.0, 40.0, 0.0, 80.0, 0.0, 40.0, 0.0])
}

#[test]
fn linearisation_at_rest_and_in_motion() {
    let (_, robot) = stock();
    let rest = robot.body(&capture()).unwrap();
    assert_eq!((robot.channels(), rest.a.nrows(), rest.b.ncols()), (13, 13, 13));
    assert_eq!(max_abs(&rest.a), 0.0, "at rest the Coriolis matrix vanishes");
    close(
        norm2(&(inverse(&rest.mass).unwrap() - &rest.b)).unwrap() + 1.0,
        1.0,
        1e-12,
    );
    // The total mass of the description is on the diagonal of the translations.
    close(rest.mass[(3, 3)], 450.2, 1e-6);
    // In motion: d(C ν)/dν ν = 2 C ν, because the bias is quadratic in ν.
    let mut moving = capture();
    moving.velocity = (0..13).map(|i| 0.1 + 0.03 * f64::from(i)).collect();
    let body = robot.body(&moving).unwrap();
    let nu = Matrix::from_fn(13, 1, |i, _| moving.velocity[i]);
    let twice: Matrix = &body.mass * &body.a * &nu;
    let mut doubled = moving.clone();
    doubled.velocity.iter_mut().for_each(|v| *v *= 2.0);
    let again = &body.mass * &robot.body(&doubled).unwrap().a * &nu;
    assert!(max_abs(&twice) > 1e-3);
    close(norm2(&(again - twice * synthesis_scale(2.0))).unwrap() + 1.0, 1.0, 1e-9);
    // With free propellant two more velocities, and the actuated part of the inverse grows: a lump was cut loose.
    let mut slosh = capture();
    slosh.slosh = true;
    let free = robot.body(&slosh).unwrap();
    assert_eq!((free.a.nrows(), free.b.ncols()), (15, 13));
    assert!(free.b[(3, 3)] > rest.b[(3, 3)]);
    assert!(free.a[(13, 13)] < 0.0, "the pendulum is damped");
}

fn synthesis_scale(x: f64) -> Matrix {
    diagonal(&[x])
}

/// With K_P = ω M every channel is v̇ = −ω v, sampled with period T and d whole periods of delay: v⁺ = v − ωT v₋d. The loop is
/// stable up to ωT = 2 sin(π/(2(2d + 1))), and its spectral radius is the largest root of z^(d+1) − z^d + ωT.
#[test]
fn sampled_loop_in_closed_form() {
    let (mut spec, robot) = stock();
    let omega = 5.0;
    let gains = Gains {
        structure: GainStructure::Scheduled,
        kp: diagonal(&[omega; 13]),
        ki: Vec::new(),
    };
    for (sensor, actuator) in [(0.0, 0.0), (0.01, 0.0), (0.01, 0.01), (0.03, 0.01), (0.004, 0.006)] {
        spec.sampling.sensor_delay_s = sensor;
        spec.sampling.actuator_delay_s = actuator;
        let found = sampled(&spec, &robot, &capture(), &gains).unwrap();
        let step = omega * spec.sampling.controller_period_s;
        // Fractions of a period on both sides add up: what counts is the time from a reading to the command made of it.
        let d = ((sensor + actuator) / 0.01_f64).round() as i32;
        let limit = 2.0 * (std::f64::consts::PI / (2.0 * f64::from(2 * d + 1))).sin();
        close(found.gain_margin_up, limit / step, 1e-3);
        // The dominant root is real for these small steps: solve z^d (1 − z) = ωT for the root next to one.
        let mut z: f64 = 1.0 - step;
        for _ in 0..200 {
            z = 1.0 - step / z.powi(d);
        }
        close(found.spectral_radius, z, 1e-9);
    }
    spec.sampling.controller_period_s = 0.0105;
    assert!(matches!(
        sampled(&spec, &robot, &capture(), &gains),
        Err(RobotError::Value { .. })
    ));
}

/// With K_P = ω M the actuators' forces mix through M, but in the coordinates of the channel errors the loop is scalar: a
/// common error of all actuators is the worst one, and μ is the peak of |w T| with T = ω e^(−sτ)/(s + ω e^(−sτ)).
#[test]
fn multiplicative_margin_of_the_decoupled_loop() {
    let (spec, robot) = stock();
    let omega = 5.0;
    let mut small = spec.clone();
    small.uncertainty.multiplicative_low = 0.5;
    small.uncertainty.multiplicative_high = 0.5 + 1e-9;
    let gains = Gains {
        structure: GainStructure::Scheduled,
        kp: diagonal(&[omega; 13]),
        ki: Vec::new(),
    };
    let (system, structure) = multiplicative_loop(&small, &robot, &capture(), &gains).unwrap();
    let found = margin(
        &system,
        &structure,
        &MarginOptions {
            starts: 3,
            ..MarginOptions::default()
        },
    )
    .unwrap();
    let delay = spec.sampling.total_delay_s();
    let peak = (0..4000)
        .map(|i| {
            let w = f64::from(i) * 0.01;
            // |ω / (jω e^(jτw)… )|: T = 1/(1 + s e^(sτ)/ω).
            let (re, im) = (1.0 - w * (w * delay).sin() / omega, w * (w * delay).cos() / omega);
            0.5 / re.hypot(im)
        })
        .fold(0.0, f64::max);
    assert!(found.guaranteed <= found.destabilising * (1.0 + 1e-9));
    close(found.guaranteed, 1.0 / peak, 3e-3);
    close(found.destabilising, 1.0 / peak, 3e-3);
}

/// The shipped gains are what their file claims.
#[test]
fn shipped_gains_reproduce_their_gamma() {
    for (spec, file) in [
        (PI, include_str!("../../../gains/pi-diagonal.toml")),
        (
            include_str!("../../../gains/p-diagonal.spec.toml"),
            include_str!("../../../gains/p-diagonal.toml"),
        ),
    ] {
        let spec: Spec = toml::from_str(spec).unwrap();
        let robot = Robot::new(URDF, &spec.robot).unwrap();
        let file: GainsFile = toml::from_str(file).unwrap();
        let gains = file.gains.gains().unwrap();
        let (_, evaluation) = report(&spec, &robot, &[], &gains).unwrap();
        close(evaluation.gamma, file.provenance.gamma_reported, 1e-6);
        assert!(file.provenance.full_order[0] <= evaluation.gamma);
        for m in &file.margins {
            assert!(
                m.guaranteed <= m.destabilising && m.destabilising <= 1.03 * m.guaranteed,
                "{m:?}"
            );
        }
        let s = sampled(&spec, &robot, &spec.models[0], &gains).unwrap();
        assert!(s.spectral_radius < 1.0 && s.gain_margin_up > 1.5, "{s:?}");
    }
}

#[test]
fn bad_input_is_refused_with_the_reason() {
    let (spec, robot) = stock();
    let with = |change: &dyn Fn(&mut Spec)| {
        let mut changed = spec.clone();
        change(&mut changed);
        problem(&changed, &robot, &[], 1, None).unwrap_err().to_string()
    };
    assert!(with(&|s| s.sampling.sensor_delay_s = -0.01).contains("zero or positive"));
    assert!(with(&|s| s.scales.velocity[3] = 0.0).contains("scales.velocity"));
    assert!(with(&|s| s.scales.authority.truncate(6)).contains("6 entries"));
    assert!(with(&|s| s.models[0].joints_deg.push(0.0)).contains("joints_deg"));
    assert!(with(&|s| s.models[0].base_mass = -1.0).contains("must be positive"));
    assert!(with(&|s| s.models.clear()).contains("at least one model"));
    assert!(Robot::new("<robot", &spec.robot).is_err());
    let mut wrong = spec.robot.clone();
    wrong.arm_links.push("elbow".into());
    assert!(Robot::new(URDF, &wrong).unwrap_err().to_string().contains("elbow"));
    assert!(
        toml::from_str::<Spec>(&PI.replace("peak = 2.0", "peek = 2.0"))
            .unwrap_err()
            .to_string()
            .contains("peek")
    );
}
