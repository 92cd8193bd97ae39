//! Tests of figures against runs with known figures.

use interfaces::{Command, Truth};
use lockstep::port::Message;
use lockstep::time::Rational;
use tape::StreamSpec;

use engine::assessment::{Assessment, AssessmentSetup, Criterion, Measured};
use lockstep::participant::ParameterError;
use toml::Table;

use super::capture::Capture;
use super::read;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn streams() -> Vec<StreamSpec> {
    let spec = |participant: &str, port: &str, descriptor, period| {
        StreamSpec::new(
            participant,
            port,
            descriptor,
            Rational::ZERO,
            Rational::from_millis(period),
        )
    };
    vec![
        spec("controller", "command", Command::descriptor(), 10),
        spec("plant", "truth", Truth::descriptor(), 1),
    ]
}

fn read_with(table: &str, streams: &[StreamSpec], plant: &str) -> Result<Capture, ParameterError> {
    let plant: Table = toml::from_str(plant).unwrap();
    read(&AssessmentSetup {
        table: &toml::from_str(table).unwrap(),
        streams,
        parameters: [("plant", &plant)].into(),
    })
}

fn assessment(extra: &str) -> Capture {
    let text = format!("kind = 'capture'\ngrasp_at = '0.05 s'\n{extra}");
    read_with(&text, &streams(), "").unwrap()
}

/// Feeds 0.1 s of samples: the truth first and then the commands, or both in time order.
fn feed_samples(
    extra: &str,
    interleaved: bool,
    truth: impl Fn(f64) -> Truth,
    command: impl Fn(f64) -> Command,
) -> Capture {
    let mut assessment = assessment(extra);
    let commands: Vec<f64> = (0..10).map(|k| f64::from(k) * 0.01).collect();
    for k in 0..=100 {
        let t = f64::from(k) * 0.001;
        assessment.sample(1, t, bytes_of(&truth(t)));
        if interleaved && k % 10 == 0 && k < 100 {
            assessment.sample(0, t, bytes_of(&command(t)));
        }
    }
    if !interleaved {
        commands
            .iter()
            .for_each(|t| assessment.sample(0, *t, bytes_of(&command(*t))));
    }
    assessment
}

fn bytes_of<M: Message>(message: &M) -> &[u8] {
    lockstep::port::__private::bytemuck::bytes_of(message)
}

fn approach_truth(t: f64) -> Truth {
    Truth {
        position_error: (0.05 - t).abs() * 0.1 + 0.001,
        attitude_error: 0.2 * DEGREE,
        relative_speed: 0.002,
        slosh: [0.1 * t, -0.3 * t],
        // a constant jerk of 6 m/s^3 along x
        v_NE_N: [3.0 * t * t, 0.5, 0.0],
        thruster_force_B: [1.0, -2.0, 0.0],
        // a couple of 0.25 N each in addition to the force
        thrust: [0.75, 0.25, 0.0, 0.0, 0.0, 0.0, 1.25, 0.75, 0.25, 0.0, 0.0, 0.25],
        slosh_swing: 0.4 * t,
        p_NB_N: [t, 0.0, 0.0],
        ..Truth::default()
    }
}

fn varying_command(t: f64) -> Command {
    let mut command = Command {
        torque_B: [0.1, -0.15, 0.0],
        force_B: [1.0, 0.0, -3.0],
        tau: [0.0; 7],
    };
    if t < 0.0199 {
        command.torque_B[2] = -0.25;
        command.tau[6] = 50.0;
    }
    command
}

#[test]
fn figures_match_their_definitions() {
    let summary = feed_samples("", true, approach_truth, varying_command).summary();
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-9, "{value} {expected}");
    near(summary.peak_base_torque_n_m, 0.25);
    near(summary.peak_base_force_n, 3.0);
    near(summary.peak_joint_torque_n_m, 50.0);
    near(summary.saturated_fraction, 0.2);
    near(summary.thrusters_saturated_fraction, 0.0);
    near(summary.base_torque_integral_n_m_s, 0.1 * 0.25 + 0.02 * 0.25);
    near(summary.base_force_integral_n_s, 0.4);
    near(summary.thruster_impulse_n_s, 101.0 * 0.001 * 3.5);
    near(summary.net_force_impulse_n_s, 101.0 * 0.001 * 3.0);
    near(summary.slosh_max_deg, 0.04 / DEGREE);
    // second differences of a parabola are exact: 36 m²/s⁶ over the nine inner intervals
    near(summary.jerk_squared_integral_m2_s5, 36.0 * 0.09);
    near(summary.slosh_joint_max_deg, 0.03 / DEGREE);
    near(summary.base_position_at_end_m[0], 0.1);
}

#[test]
fn figures_do_not_depend_on_stream_order() {
    let [one, other] =
        [true, false].map(|interleaved| feed_samples("", interleaved, approach_truth, varying_command).summary());
    assert_eq!(one, other);
}

/// A measure of the scenario with a limit of 2 mm.
fn measured(value: f64) -> Measured {
    let criterion = Criterion {
        name: "miss".to_owned(),
        value: Some(value),
        limit: Some(2.0),
        unit: "mm".to_owned(),
        met: value <= 2.0,
        ..Criterion::default()
    };
    Measured {
        name: criterion.name.clone(),
        unit: criterion.unit.clone(),
        value: value.into(),
        t_s: serde_json::Value::Null,
        reason: None,
        criterion: Some(criterion),
    }
}

#[test]
fn captured_requires_all_measures_and_criteria() {
    let criteria = "[criteria]\nsaturated_fraction = 0.25\njoint_ranges = '1 deg'";
    let figures = |extra: &str, measures: Vec<Measured>| {
        feed_samples(extra, true, approach_truth, varying_command).finish(measures)
    };
    let good = figures(criteria, vec![measured(1.0)]);
    assert!(good.met() && good.values["captured"] == true, "{good:?}");
    let text = good.text();
    assert!(text.starts_with("captured\n  ok   miss "), "{text}");
    assert!(
        text.contains("1.00 mm (at most 2.00 mm)\n  ok   saturated fraction "),
        "{text}"
    );
    assert!(text.contains("\n       peak base torque "), "{text}");
    let missed = figures(criteria, vec![measured(3.0)]);
    assert!(!missed.met() && missed.values["captured"] == false, "{missed:?}");
    assert!(
        missed
            .text()
            .starts_with("no capture: a criterion is not met\n  FAIL miss ")
    );
    let strict = figures("[criteria]\nsaturated_fraction = 0.1", vec![measured(1.0)]);
    assert!(
        !strict.met() && strict.values["captured"] == false,
        "20 % of the samples saturate"
    );
    let none = figures("", Vec::new());
    assert!(
        none.met() && none.values["captured"] == false,
        "nothing was asked of it"
    );
    assert!(
        none.text().starts_with("complete, without a criterion\n"),
        "{}",
        none.text()
    );
}

#[test]
fn joint_ranges_criterion_limits_the_joint_angles() {
    let bent = |t| Truth {
        q: [0.0, 0.0, -2.0 * t, 0.0, 0.0, 0.0, 0.0],
        ..approach_truth(t)
    };
    let figures = |range: &str| {
        let extra = format!("[criteria]\njoint_ranges = '{range}'");
        feed_samples(&extra, true, bent, varying_command).finish(Vec::new())
    };
    let at_most = 0.2 / DEGREE;
    assert!(figures(&format!("{} deg", at_most + 0.01)).met());
    assert!(!figures(&format!("{} deg", at_most - 0.01)).met());
}

#[test]
fn criterion_on_samples_that_are_no_numbers_is_not_met() {
    let broken = |t| Truth {
        q: std::array::from_fn(|joint| if joint == 3 && t < 0.01 { f64::NAN } else { 0.0 }),
        ..approach_truth(t)
    };
    let mute = |_| Command {
        torque_B: [0.0, f64::NAN, 0.0],
        force_B: [0.0; 3],
        tau: [0.0; 7],
    };
    let ranges = "[criteria]\njoint_ranges = '1 deg'";
    let figures = feed_samples(ranges, true, broken, varying_command).finish(Vec::new());
    let criterion = &figures.criteria[0];
    assert!(!figures.met() && criterion.value.is_none(), "{criterion:?}");
    assert!(
        criterion.reason.as_ref().unwrap().contains("not a number"),
        "{criterion:?}"
    );
    let saturated = "[criteria]\nsaturated_fraction = 0.5";
    let mut assessment = feed_samples(saturated, true, approach_truth, mute);
    assert!(assessment.summary().peak_base_torque_n_m.is_nan());
    assert!(!assessment.finish(Vec::new()).met());
}

#[test]
fn early_end_is_no_capture_and_gives_the_reason() {
    let mut assessment = assessment("");
    assessment.sample(1, 0.0, bytes_of(&approach_truth(0.0)));
    assessment.sample(0, 0.0, bytes_of(&varying_command(0.0)));
    let figures = assessment.finish(vec![measured(1.0)]);
    assert!(!figures.met() && figures.values["captured"] == false);
    assert!(
        figures.text().contains("before the grasp at 0.05 s"),
        "{}",
        figures.text()
    );
}

#[test]
fn invalid_table_is_rejected_with_its_key() {
    let refuse = |text: &str, streams: &[StreamSpec]| {
        let error = read_with(text, streams, "").err().unwrap();
        (error.key, error.reason)
    };
    let good = "kind = 'capture'\ngrasp_at = '30 s'\n";
    for (extra, key, part) in [
        ("truth = 'plant.lies'", "truth", "plant.truth"),
        ("truth = 'controller.command'", "truth", "`p_NB_N`"),
        ("[criteria]\njoint_ranges = 3", "criteria.joint_ranges", "30 deg"),
        ("[criteria]\nslosh = '3 deg'", "criteria.slosh", "unknown field"),
        ("[limits]\ntorque = '1 N'", "limits.torque", "a torque"),
        ("[criteria]\njoint_ranges = '-1 deg'", "criteria.joint_ranges", "-1 deg"),
        (
            "[criteria]\njoint_ranges = '0 deg'",
            "criteria.joint_ranges",
            "not above zero",
        ),
        (
            "[criteria]\njoint_ranges = '[9, 9, 9, 9, 9, -9, 9] deg'",
            "criteria.joint_ranges",
            "number 6 of 7",
        ),
        (
            "[criteria]\nsaturated_fraction = nan",
            "criteria.saturated_fraction",
            "NaN",
        ),
        (
            "[criteria]\nsaturated_fraction = -1",
            "criteria.saturated_fraction",
            "-1",
        ),
        (
            "[criteria]\nsaturated_fraction = 2",
            "criteria.saturated_fraction",
            "from 0 to 1",
        ),
        ("[limits]\ntorque = '-1 N m'", "limits.torque", "-1 N m"),
        ("[limits]\nforce = '[9, 0, 9] N'", "limits.force", "number 2 of 3"),
        (
            "[limits]\njoint_torque = '-5 N m'",
            "limits.joint_torque",
            "not above zero",
        ),
    ] {
        let (found, reason) = refuse(&format!("{good}{extra}"), &streams());
        assert_eq!(found, key, "{reason}");
        assert!(reason.contains(part), "{reason}");
    }
    let (key, reason) = refuse(good, &streams()[..1]);
    assert_eq!(key, "truth");
    assert!(reason.contains("controller.command"), "{reason}");
    assert_eq!(refuse("kind = 'capture'", &streams()).1, "missing field `grasp_at`");
}

/// A run that was stopped after its grasp met every criterion so far; it is no capture all the same.
#[test]
fn unfinished_run_is_no_capture() {
    let held = |_: f64| Truth {
        grasped: true,
        ..Truth::default()
    };
    let mut complete = feed_samples("[criteria]\nsaturated_fraction = 0.5", false, held, |_| {
        Command::default()
    });
    let figures = complete.finish(Vec::new());
    assert_eq!(figures.values["captured"], true);
    let unfinished = figures.of_unfinished();
    assert_eq!(unfinished.values["captured"], false);
    assert_eq!(unfinished.values["incomplete"], "the run did not complete");
    assert!(
        unfinished.text().starts_with("no verdict: the run did not complete"),
        "{}",
        unfinished.text()
    );
}

#[test]
fn limits_are_those_of_the_plant_unless_given() {
    let plant = "[actuators]\nwheels = { torque = '60 mN m' }\nthrusters = { force = '[0.6, 0, 9] N' }";
    let stock_joints = [320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0];
    let limits = |extra: &str, plant: &str| {
        let text = format!("kind = 'capture'\ngrasp_at = '30 s'\n{extra}");
        read_with(&text, &streams(), plant).unwrap().limits
    };
    let joined = |first: [f64; 6], joints: [f64; 7]| [&first[..], &joints[..]].concat();
    let near = |found: [f64; 13], expected: Vec<f64>| {
        assert!(
            found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-15),
            "{found:?} {expected:?}"
        );
    };
    near(limits("", ""), joined([0.2, 0.2, 0.2, 9.0, 9.0, 9.0], stock_joints));
    near(
        limits("", plant),
        joined([0.06, 0.06, 0.06, 0.6, 0.0, 9.0], stock_joints),
    );
    let given = "[limits]\nforce = '3 N'\njoint_torque = '5 N m'";
    near(
        limits(given, plant),
        joined([0.06, 0.06, 0.06, 3.0, 3.0, 3.0], [5.0; 7]),
    );
    // another plant's table
    let other = "actuators = ['a', 'b']";
    near(limits("", other), joined([0.2, 0.2, 0.2, 9.0, 9.0, 9.0], stock_joints));
}
