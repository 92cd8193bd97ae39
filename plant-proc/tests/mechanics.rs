//! Conservation laws at the grasp and under actuator faults.

mod common;

use common::{Tape, load, run};
use toml::{Table, Value};

/// The close capture, cut short, with other parameters of the plant.
fn run_short(duration: &str, plant: &str) -> Tape {
    let mut scenario = load("close");
    scenario["duration"] = duration.into();
    let extra: Table = toml::from_str(plant).unwrap();
    let parameters = scenario["participants"]["plant"]["parameters"].as_table_mut().unwrap();
    for (key, value) in extra {
        match (parameters.get_mut(&key), value) {
            (Some(Value::Table(old)), Value::Table(new)) => old.extend(new),
            (_, value) => {
                parameters.insert(key, value);
            }
        }
    }
    run(&scenario)
}

fn residuals(tape: &Tape) -> f64 {
    ["linear_residual_N", "angular_residual_N", "energy_residual"]
        .map(|field| tape.peak("plant.truth", field))
        .into_iter()
        .fold(0.0, f64::max)
}

#[test]
fn a_hard_grasp_conserves_momentum_and_loses_energy() {
    // the gripper closes on a target that passes at 0.2 m/s with a high spin rate
    let tape = run_short(
        "0.3 s",
        "after_grasp = { at = '0.1 s', within = '10 m', within_angle = '180 deg' }\n\
         target_start = { velocity = '[0.1, -0.1, 0.15] m/s', rate = '[5, -3, 10] deg/s' }",
    );
    assert_eq!(tape.at("plant.truth", "grasped", 0, 0.1), 0.0);
    assert_eq!(tape.at("plant.truth", "grasped", 0, 0.101), 1.0);
    // a plastic impact loses energy, but no more than was available
    let (loss, before) = (
        tape.at("plant.truth", "impact_loss", 0, 0.3),
        tape.at("plant.truth", "energy", 0, 0.1),
    );
    assert!(loss > 1e-3 * before && loss < before, "{loss} of {before}");
    assert!(residuals(&tape) < 1e-8, "{:e}", residuals(&tape));
    // rigidly held: the distance between end effector and grasp frame stays constant
    let distance = |t| tape.at("plant.truth", "position_error", 0, t);
    assert!((distance(0.101) - distance(0.3)).abs() < 1e-9);
    assert!(tape.at("plant.truth", "relative_rate", 0, 0.2) < 1e-12);
}

#[test]
fn locked_joint_holds_its_position_and_the_ledger_closes() {
    let tape = run_short(
        "12 s",
        "faults = [{ actuator = 'joint.A4', effect = 'locked', from = '8 s', until = '10 s' }]",
    );
    let angle = |t| tape.at("plant.truth", "q", 3, t);
    assert!((angle(7.9) - angle(8.0)).abs() > 1e-5, "it moved before");
    assert_eq!(angle(8.002), angle(9.999));
    assert!((angle(10.001) - angle(11.0)).abs() > 1e-5, "it moves again");
    assert!(tape.at("plant.truth", "impact_loss", 0, 12.0) > 0.0);
    assert!(residuals(&tape) < 1e-8, "{:e}", residuals(&tape));
}

#[test]
fn faults_act_on_their_actuator_in_their_window() {
    let tape = run_short(
        "6 s",
        "faults = [{ actuator = 'wheel.y', effect = 'weak', factor = 0.5, from = '3 s', until = '4 s' },\n\
         { actuator = 'thruster.8', effect = 'on', from = '5 s' }]",
    );
    let applied = |axis, t| tape.at("plant.truth", "wheel_torque_B", axis, t);
    let commanded = |axis, t| tape.at("controller.command", "torque_B", axis, t);
    // the truth stamped t holds the forces over the period that ends at t, with the command of the last 10 ms
    for (t, factor) in [(2.5, 1.0), (3.5, 0.5), (4.5, 1.0)] {
        assert_eq!(applied(1, t), factor * commanded(1, t - 0.01), "{t}");
        assert_eq!(applied(0, t), commanded(0, t - 0.01), "{t}");
    }
    // thruster 8, the first of two along +z, pushes with 4.5 N and turns the base about y on its arm of half a metre
    let torque = tape.at("plant.truth", "thruster_torque_B", 1, 5.5);
    let force = tape.at("plant.truth", "thruster_force_B", 2, 5.5);
    assert!(torque > 1.0 && force > 1.0, "{torque} {force}");
    assert_eq!(tape.at("plant.truth", "thruster_torque_B", 1, 4.5), 0.0);
    assert!(residuals(&tape) < 1e-8);
}

#[test]
fn wheels_conserve_momentum_with_and_without_gyroscopy() {
    for gyroscopic in [false, true] {
        let wheels = format!(
            "actuators = {{ wheels = {{ torque = '0.2 N m', momentum = '12 N m s', start_momentum = '[3, -4, 5] N m s', \
             gyroscopic = {gyroscopic} }} }}\nstart = {{ rate = '[1, 2, -1] deg/s' }}"
        );
        let tape = run_short("3 s", &wheels);
        assert!(residuals(&tape) < 1e-9, "{gyroscopic}: {:e}", residuals(&tape));
    }
}

/// The compensating torque changes the wheels' momentum like any other: without a command, 11 and 11 N m s on a base that turns at 1 deg/s
/// would become 15.5 N m s about one axis.
#[test]
fn compensating_wheels_hold_their_momentum_limit() {
    for (start_momentum, rate) in [
        ("[11, 11, 0] N m s", "[0, 0, 1] deg/s"),
        ("[-3, 11.5, 11.9] N m s", "[4, 1, -2] deg/s"),
    ] {
        let parameters = format!(
            "actuators = {{ wheels = {{ torque = '0 N m', momentum = '12 N m s', start_momentum = '{start_momentum}' }}, \
             thrusters = {{ force = '0 N' }}, joints = {{ torque = '0 N m' }} }}\nstart = {{ rate = '{rate}' }}"
        );
        let tape = run_short("60 s", &parameters);
        let peak = tape.peak("plant.truth", "wheel_momentum_B");
        assert!(peak > 12.0 - 1e-6, "the wheels fill: {peak}");
        assert!(peak < 12.0 + 1e-6, "{peak}");
        assert!(residuals(&tape) < 1e-8, "{:e}", residuals(&tape));
        // the wheels' gyroscopic torque acts on the base only once a wheel is saturated
        let rate = |t| [0, 1, 2].map(|axis| tape.at("plant.truth", "omega_NB_B", axis, t));
        assert!(
            rate(0.0).iter().zip(rate(60.0)).any(|(a, b)| (a - b).abs() > 1e-3),
            "{:?}",
            rate(60.0)
        );
    }
}

/// The key and the reason with which a plant refuses these parameters.
fn refused(plant: &str) -> (String, String) {
    let scenario = load("close");
    let mut parameters = scenario["participants"]["plant"]["parameters"]
        .as_table()
        .unwrap()
        .clone();
    parameters.extend(toml::from_str::<Table>(plant).unwrap());
    let setup = lockstep::participant::Setup {
        name: "plant".to_owned(),
        parameters,
        seed: 1,
        period: 0.001,
        offset: 0.0,
    };
    let error = plant_proc::factory(&setup).err().unwrap();
    (error.key, error.reason)
}

fn assert_refused(cases: &[(&str, &str, &str)]) {
    for (plant, key, part) in cases {
        let (found, reason) = refused(plant);
        assert_eq!(found, *key, "{reason}");
        assert!(reason.contains(part), "{plant}: {reason}");
    }
}

#[test]
fn invalid_parameters_are_rejected_with_key_and_remedy() {
    assert_refused(&[
        ("starts = 1", "starts", "unknown field"),
        (
            "integrator = { method = 'euler' }",
            "integrator.method",
            "rk4 and dop853",
        ),
        ("integrator = { substeps = 0 }", "integrator.substeps", "between 1"),
        (
            "faults = [{ actuator = 'wheel.w', effect = 'off' }]",
            "faults[0].actuator",
            "wheel.x",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'locked' }]",
            "faults[0].effect",
            "joints",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'weak' }]",
            "faults[0].factor",
            "factor = 0.5",
        ),
        (
            "actuators = { wheels = { torque = '0.2 N' } }",
            "actuators.wheels.torque",
            "a torque",
        ),
        (
            "actuators = { wheels = { torque = '-1 N m' } }",
            "actuators.wheels.torque",
            "negative",
        ),
        (
            "sensors = { rate = { drift = '1 deg/s' } }",
            "sensors.rate.drift_time",
            "time constant",
        ),
        (
            "sensors = { rate = { period = '1.5 ms' } }",
            "sensors.rate.period",
            "multiple",
        ),
        ("urdf = 'x'", "urdf", ""),
    ]);
}

#[test]
fn values_out_of_range_are_rejected_with_key_and_remedy() {
    let target = |mass: &str, inertia: &str| {
        format!("target = {{ mass = '{mass}', inertia = '{inertia}', grasp = {{ position = '[0, 0, -0.6] m' }} }}")
    };
    assert_refused(&[
        (
            "faults = [{ actuator = 'wheel.x', effect = 'weak', factor = -1 }]",
            "faults[0].factor",
            "-1 is not a fraction",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'weak', factor = 7 }]",
            "faults[0].factor",
            "from 0 to 1",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'weak', factor = nan }]",
            "faults[0].factor",
            "NaN",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'off', from = '-5 s' }]",
            "faults[0].from",
            "-5 s is before the start",
        ),
        (
            "faults = [{ actuator = 'wheel.x', effect = 'off', until = '-1 s' }]",
            "faults[0].until",
            "-1 s is not after",
        ),
        ("after_grasp = { at = '-1 s' }", "after_grasp.at", "-1 s is before"),
        (
            "after_grasp = { at = '30 s', within = '-1 mm' }",
            "after_grasp.within",
            "-0.001 m is not above zero",
        ),
        (
            "after_grasp = { at = '30 s', within_angle = '0 deg' }",
            "after_grasp.within_angle",
            "0 deg is not above zero",
        ),
        (&target("-1 kg", "9 kg m^2"), "target.mass", "-1 kg is not above zero"),
        (&target("0 kg", "9 kg m^2"), "target.mass", "0 kg is not above zero"),
        (
            &target("9 kg", "[9, -9, 9] kg m^2"),
            "target.inertia",
            "-9 kg m^2 about y",
        ),
        (
            &target("9 kg", "[9, 1, 1] kg m^2"),
            "target.inertia",
            "triangle inequality",
        ),
    ]);
}

#[test]
fn laws_refuse_in_the_names_and_units_of_the_scenario() {
    for (name, parameters, key, reason) in [
        (
            "guidance",
            "schedule = { start = '1 s', point = '20 s', grasp = '5 s' }",
            "schedule.grasp",
            "5 s must not be before schedule.point",
        ),
        (
            "controller",
            "outer = { weights = { near = '5 m', far = '1 m' } }",
            "outer.weights.far",
            "1 m must be larger than outer.weights.near",
        ),
        (
            "controller",
            "avoidance = { margin = '400 deg' }",
            "avoidance.margin",
            "400 deg must be less than half of each joint's range, from avoidance.lower to avoidance.upper",
        ),
    ] {
        let mut scenario = load("close");
        let own = scenario["participants"][name]["parameters"].as_table_mut().unwrap();
        own.extend(toml::from_str::<Table>(parameters).unwrap());
        let error = common::try_make(&scenario, name).err().unwrap();
        assert_eq!((error.key.as_str(), error.reason.as_str()), (key, reason));
    }
}

#[test]
fn target_without_mass_is_refused_by_all_that_know_it() {
    for name in ["plant", "controller", "guidance"] {
        let mut scenario = load("capture-and-stabilise");
        scenario["participants"][name]["parameters"]["target"]["mass"] = "-1 kg".into();
        let error = common::try_make(&scenario, name).err().unwrap();
        assert_eq!(error.key, "target.mass", "{name}: {error}");
    }
}

#[test]
fn spherical_pendulum_ledger_closes_at_grasp_and_brake() {
    // the bob starts next to the first hinge's axis, where two hinges lose a degree of freedom, and swings through it
    let tape = run_short(
        "6 s",
        "slosh = 'spherical'\n\
         start = { slosh = '[20, 85] deg', slosh_rates = '[0, 40] deg/s' }\n\
         faults = [{ actuator = 'joint.A4', effect = 'locked', from = '3 s', until = '4 s' }]\n\
         after_grasp = { at = '5 s', within = '10 m', within_angle = '180 deg' }\n\
         target_start = { velocity = '[0.1, -0.1, 0.15] m/s' }",
    );
    assert_eq!(tape.at("plant.truth", "grasped", 0, 5.001), 1.0);
    assert!(tape.at("plant.truth", "impact_loss", 0, 6.0) > 1e-3);
    assert!(residuals(&tape) < 1e-8, "{:e}", residuals(&tape));
    assert!(tape.peak("plant.truth", "slosh_swing") > 1.6);
    // the direction keeps unit length
    for t in [0.0, 1.0, 5.0, 6.0] {
        let parts = [0, 1, 2].map(|axis| tape.at("plant.truth", "slosh_direction_B", axis, t));
        let length = parts.iter().map(|part| part * part).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-12, "{length}");
    }
}

#[test]
fn pendulum_models_agree_for_small_swings() {
    let hinged = run_short("8 s", "");
    let spherical = run_short("8 s", "slosh = 'spherical'");
    let swing = hinged.peak("plant.truth", "slosh_swing");
    assert!((0.05..0.7).contains(&swing), "{swing}");
    for t in [2.0, 4.0, 6.0, 8.0] {
        for axis in 0..2 {
            let [a, b] = [&hinged, &spherical].map(|tape| tape.at("plant.truth", "slosh", axis, t));
            // differs to second order in the angle, and by the bob's inertia about its rod
            assert!((a - b).abs() < 0.1 * swing * swing, "{t} s, {axis}: {a} {b}");
        }
    }
    let [a, b] = [&hinged, &spherical].map(|tape| tape.at("plant.truth", "position_error", 0, 8.0));
    assert!((a - b).abs() < 1e-4, "{a} {b}");
}

#[test]
fn spherical_pendulum_rejects_unsuitable_hinges() {
    let mut scenario = load("close");
    let plant = scenario["participants"]["plant"]["parameters"].as_table_mut().unwrap();
    plant.insert("slosh".into(), "spherical".into());
    let urdf = plant["urdf"].as_str().unwrap();
    let urdf = urdf.replace("<origin xyz=\"0 0 -0.1317\"", "<origin xyz=\"0.1 0 -0.1317\"");
    plant.insert("urdf".into(), urdf.into());
    let error = common::try_make(&scenario, "plant").err().unwrap().to_string();
    assert!(
        error.contains("must hang along base -z") && error.contains("hinges"),
        "{error}"
    );
}
