//! The velocity loop of the stock servicer: linearisation, sampled loop in closed form, margins, and the shipped files.

use synthesis::linalg::{Matrix, diagonal, inverse, max_abs, norm2};
use synthesis::mu::{MarginOptions, margin};
use synthesis::robot::{
    GainStructure, Gains, GainsFile, LoopTiming, ModelSpec, Robot, RobotError, SampledLoop, SlidingGainError, Spec,
    assess, design, multiplicative_loop, problem, random_situation, report, sampled, validate,
};
use synthesis::tuner::SearchControl;

const URDF: &str = include_str!("../../../models/servicer.urdf");
const PI: &str = include_str!("../../../gains/pi-diagonal.spec.toml");

fn assert_close(found: f64, expected: f64, relative: f64) {
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
    let rest = robot.linearise(&capture()).unwrap();
    assert_eq!((robot.channels(), rest.a.nrows(), rest.b.ncols()), (13, 13, 13));
    assert_eq!(max_abs(&rest.a), 0.0, "at rest the Coriolis matrix vanishes");
    assert_close(
        norm2(&(inverse(&rest.mass).unwrap() - &rest.b)).unwrap() + 1.0,
        1.0,
        1e-12,
    );
    // The total mass of the description is on the diagonal of the translations.
    assert_close(rest.mass[(3, 3)], 450.2, 1e-6);
    // In motion: d(C ν)/dν ν = 2 C ν, because the bias is quadratic in ν.
    let mut moving = capture();
    moving.velocity = (0..13).map(|i| 0.1 + 0.03 * f64::from(i)).collect();
    let body = robot.linearise(&moving).unwrap();
    let nu = Matrix::from_fn(13, 1, |i, _| moving.velocity[i]);
    let twice: Matrix = &body.mass * &body.a * &nu;
    let mut doubled = moving.clone();
    doubled.velocity.iter_mut().for_each(|v| *v *= 2.0);
    let again = &body.mass * &robot.linearise(&doubled).unwrap().a * &nu;
    assert!(max_abs(&twice) > 1e-3);
    assert_close(norm2(&(again - twice * synthesis_scale(2.0))).unwrap() + 1.0, 1.0, 1e-9);
    // With free propellant there are two more velocities, and the actuated part of the inverse grows: a rigid mass was released.
    let mut slosh = capture();
    slosh.slosh = true;
    let free = robot.linearise(&slosh).unwrap();
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
        assert_close(found.gain_margin_up, limit / step, 1e-3);
        // The dominant root is real for these small steps: solve z^d (1 − z) = ωT for the root next to one.
        let mut z: f64 = 1.0 - step;
        for _ in 0..200 {
            z = 1.0 - step / z.powi(d);
        }
        assert_close(found.spectral_radius, z, 1e-9);
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
    assert_close(found.guaranteed, 1.0 / peak, 3e-3);
    assert_close(found.destabilising, 1.0 / peak, 3e-3);
}

/// Copies the joint angles from the file into the situations given as an instant of a run.
fn look_up_configurations(spec: &mut Spec, file: &GainsFile) {
    for model in spec.models.iter_mut().filter(|model| model.at.is_some()) {
        let same = |then: &&ModelSpec| then.name == model.name && then.at == model.at;
        let then = file.models.iter().find(same).expect("the file has the angles");
        model.joints_deg.clone_from(&then.joints_deg);
    }
}

/// The rule of the specifications: errors of size one have the same kinetic energy in every channel, in every configuration.
#[test]
fn error_sizes_of_every_capture_follow_one_rule() {
    let mut spec: Spec = toml::from_str(PI).unwrap();
    let robot = Robot::new(URDF, &spec.robot).unwrap();
    look_up_configurations(
        &mut spec,
        &toml::from_str(include_str!("../../../gains/pi-diagonal.toml")).unwrap(),
    );
    for model in &spec.models {
        let sizes = if model.error_sizes.is_empty() {
            &spec.scales.velocity
        } else {
            &model.error_sizes
        };
        let mass = robot.linearise(model).unwrap().mass;
        for (channel, size) in sizes.iter().enumerate() {
            assert_close(size * mass[(channel, channel)].sqrt(), 7.5e-3, 0.03);
        }
    }
}

/// K_S is the result of the proportional specification; other gains are rejected.
#[test]
fn shipped_sliding_gain_is_that_of_the_p_structure() {
    let read = |text: &str| toml::from_str::<GainsFile>(text).unwrap();
    let proportional = read(include_str!("../../../gains/p-diagonal.toml"));
    for text in [
        include_str!("../../../gains/pi-diagonal.toml"),
        include_str!("../../../gains/pi-block.toml"),
        include_str!("../../../gains/pi-full.toml"),
    ] {
        let mut file = read(text);
        assert_eq!(file.gains.ks, proportional.gains.kp);
        assert_eq!(file.provenance.ks.as_deref(), Some("gains/p-diagonal.toml"));
        let other = file.gains.clone();
        assert_eq!(file.gains.take_sliding_gain(&other), Err(SlidingGainError::Integral));
    }
}

/// Lags of single channels: equal lags are the specification's lag, and a lag of zero is no lag.
#[test]
fn lags_of_single_channels_enter_the_sampled_loop() {
    let (mut spec, robot) = stock();
    let body = robot.linearise(&capture()).unwrap();
    let gains = Gains {
        structure: GainStructure::Scheduled,
        kp: diagonal(&[5.0; 13]),
        ki: Vec::new(),
    };
    let kp = gains.proportional(&body.mass).unwrap();
    let radius = |lag_s: [f64; 13]| {
        let timing = LoopTiming {
            lag_s: lag_s.into(),
            ..LoopTiming::new(&spec.sampling, 13)
        };
        let ki = Matrix::zeros(13, 0);
        SampledLoop::new(&timing, &body, &kp, &ki)
            .unwrap()
            .radius(1.0, 0.0)
            .unwrap()
    };
    let mut wheels = [0.0; 13];
    wheels[..3].fill(0.5);
    let (none, some, all) = (radius([0.0; 13]), radius(wheels), radius([0.5; 13]));
    let mut nothing = wheels;
    nothing[3..].fill(1e-7);
    assert_close(radius(nothing), some, 1e-6);
    // With these gains every channel has the same cut-off, so the longest lag decides, on whichever channel it is.
    let mut joints = [0.0; 13];
    joints[6..].fill(0.25);
    let shorter = radius(joints);
    assert!(
        none + 1e-3 < shorter && shorter < some - 1e-3,
        "{none} {shorter} {some}"
    );
    assert_close(all, some, 1e-6);
    spec.sampling.actuator_lag_s = 0.5;
    assert_close(
        sampled(&spec, &robot, &capture(), &gains).unwrap().spectral_radius,
        all,
        1e-12,
    );
}

/// The shipped gains match the claims of their file, on the models of the specification and on those of the adversary.
#[test]
fn shipped_gains_reproduce_their_gamma() {
    macro_rules! shipped {
        ($($name:literal),*) => {
            [$((
                include_str!(concat!("../../../gains/", $name, ".spec.toml")),
                include_str!(concat!("../../../gains/", $name, ".toml")),
            )),*]
        };
    }
    for (spec, file) in shipped!(
        "p-diagonal",
        "pi-diagonal",
        "pi-block",
        "pi-full",
        "pi-scheduled",
        "pi-diagonal-five"
    ) {
        let mut spec: Spec = toml::from_str(spec).unwrap();
        let robot = Robot::new(URDF, &spec.robot).unwrap();
        let file: GainsFile = toml::from_str(file).unwrap();
        look_up_configurations(&mut spec, &file);
        assert_eq!(spec.gains.ks.is_some(), !file.gains.ks.is_empty(), "{}", spec.title);
        let gains = file.gains.gains().unwrap();
        let (_, evaluation) = report(&spec, &robot, &file.adversary, &gains).unwrap();
        assert_close(evaluation.gamma, file.provenance.gamma_reported, 1e-6);
        assert!(file.full_order.iter().all(|o| o.unreachable <= evaluation.gamma));
        assert_eq!(file.full_order.len(), spec.models.len() + file.adversary.len());
        assert_eq!(file.margins.len(), 2 * spec.models.len(), "both sets, every model");
        for m in &file.margins {
            assert!(
                m.guaranteed <= m.destabilising && m.destabilising <= 1.03 * m.guaranteed,
                "{m:?}"
            );
        }
        for model in &spec.models {
            let s = sampled(&spec, &robot, model, &gains).unwrap();
            assert!(s.spectral_radius < 1.0 && s.gain_margin_up > 1.2, "{s:?}");
        }
    }
}

/// The scheduled gains pass the validation set that their specification states, situation by situation.
#[test]
fn the_scheduled_gains_pass_their_validation_set() {
    let spec: Spec = toml::from_str(include_str!("../../../gains/pi-scheduled.spec.toml")).unwrap();
    let file: GainsFile = toml::from_str(include_str!("../../../gains/pi-scheduled.toml")).unwrap();
    let robot = Robot::new(URDF, &spec.robot).unwrap();
    let validation = validate(&spec, &robot, &file.gains.gains().unwrap(), 2, &|_| {}).unwrap();
    assert_eq!(validation.samples.len(), 100);
    assert!(validation.passed(), "worst gamma {}", validation.worst_gamma());
    assert_close(validation.worst_gamma(), file.validation.unwrap().worst_gamma, 1e-6);
}

/// The adversary adds new situations, inside the ranges and not taken from the validation set.
#[test]
fn adversary_adds_the_worst_situations() {
    let mut spec: Spec = toml::from_str(include_str!("../../../gains/pi-scheduled.spec.toml")).unwrap();
    let robot = Robot::new(URDF, &spec.robot).unwrap();
    spec.models.truncate(1);
    spec.gains.integral = false;
    spec.weights.load = None;
    spec.search.starts = 1;
    (spec.search.iterations, spec.search.finishing, spec.search.rounds) = (25, 2, 1);
    (spec.validation.samples, spec.validation.rounds, spec.validation.added) = (8, 1, 2);
    spec.validation.gamma = 1.01;
    let found = design(&spec, &robot, 2, &|_| SearchControl::Continue).unwrap();
    assert_eq!(found.adversary.len(), 2);
    // The model alone; with the adversary's models; and these to convergence.
    assert_eq!(found.rounds.iter().map(|r| r.models).collect::<Vec<_>>(), [1, 3, 3]);
    assert!(found.rounds[1].gamma > found.rounds[0].gamma && found.rounds[2].gamma <= found.rounds[1].gamma);
    // The added situations were bad for the earlier gains, and are better with the gains tuned for them.
    spec.validation.rounds = 0;
    let first = design(&spec, &robot, 2, &|_| SearchControl::Continue).unwrap();
    assert_eq!(first.rounds[..], found.rounds[..1]);
    let worst = &found.adversary[0];
    let gamma = |gains| assess(&spec, &robot, worst, gains, 2).unwrap().gamma;
    assert!(gamma(&first.gains) > first.rounds[0].worst_gamma);
    assert!(gamma(&found.gains) < gamma(&first.gains));
    for (k, model) in found.adversary.iter().enumerate() {
        assert_eq!(model.name, format!("adversary 1.{}", k + 1));
        let inside = model.joints_deg.iter().zip(&spec.validation.joints_deg);
        assert!(inside.clone().all(|(q, range)| q.abs() <= *range));
        assert!((0.9..=1.1).contains(&model.base_mass) && (0.0..=0.005).contains(&model.extra_delay_s));
        assert!((0..8).all(|i| random_situation(&spec, i).joints_deg != model.joints_deg));
    }
    // If no situation exceeds the limit, none is added.
    spec.validation.gamma = 1e3;
    let content = design(&spec, &robot, 2, &|_| SearchControl::Continue).unwrap();
    assert!(content.adversary.is_empty() && content.rounds.len() == 1);
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
    assert!(with(&|s| s.models[1].at = Some("runs/a:30s".into())).contains("has not been looked up"));
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
