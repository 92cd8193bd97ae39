//! Figures of runs whose figures are known beforehand.

use interfaces::{Command, Truth};
use lockstep::port::Message;
use lockstep::time::Rational;
use tape::StreamSpec;

use engine::assessment::{Assessment, Figures};

use super::capture::Capture;
use super::{Summary, read};

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

fn assessment(extra: &str) -> Capture {
    let text = format!("kind = 'capture'\ngrasp_at = '0.05 s'\n{extra}");
    read(&toml::from_str(&text).unwrap(), &streams()).unwrap()
}

/// Feeds 0.1 s, the truth first and then the commands, or both as they come.
fn fed(extra: &str, interleaved: bool, truth: impl Fn(f64) -> Truth, command: impl Fn(f64) -> Command) -> Summary {
    let mut assessment = assessment(extra);
    let commands: Vec<f64> = (0..10).map(|k| f64::from(k) * 0.01).collect();
    for k in 0..=100 {
        let t = f64::from(k) * 0.001;
        assessment.sample(1, t, bytemuck(&truth(t)));
        if interleaved && k % 10 == 0 && k < 100 {
            assessment.sample(0, t, bytemuck(&command(t)));
        }
    }
    if !interleaved {
        commands
            .iter()
            .for_each(|t| assessment.sample(0, *t, bytemuck(&command(*t))));
    }
    assessment.summary()
}

fn bytemuck<M: Message>(message: &M) -> &[u8] {
    lockstep::port::__private::bytemuck::bytes_of(message)
}

fn approach(t: f64) -> Truth {
    Truth {
        position_error: (0.05 - t).abs() * 0.1 + 0.001,
        attitude_error: 0.2 * DEGREE,
        relative_speed: 0.002,
        slosh: [0.1 * t, -0.3 * t],
        // a constant jerk of 6 m/s^3 along x
        v_NE_N: [3.0 * t * t, 0.5, 0.0],
        thruster_force_B: [1.0, -2.0, 0.0],
        // a couple of 0.25 N each beside the force
        thrust: [0.75, 0.25, 0.0, 0.0, 0.0, 0.0, 1.25, 0.75, 0.25, 0.0, 0.0, 0.25],
        slosh_swing: 0.4 * t,
        p_NB_N: [t, 0.0, 0.0],
        ..Truth::default()
    }
}

fn wiggle(t: f64) -> Command {
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
fn figures_are_those_of_the_definitions() {
    let summary = fed("", true, approach, wiggle);
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-9, "{value} {expected}");
    near(summary.position_error_at_grasp_m.unwrap(), 0.001);
    near(summary.attitude_error_at_grasp_deg.unwrap(), 0.2);
    near(summary.relative_speed_at_grasp_m_s.unwrap(), 0.002);
    near(summary.largest_error_after_grasp_m.unwrap(), 0.006);
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
    assert!(!summary.captured, "20 % of the samples saturate");
    let failed: Vec<&str> = summary
        .criteria
        .iter()
        .filter(|c| !c.met)
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(failed, ["saturated_fraction"]);
}

#[test]
fn the_order_of_the_streams_does_not_matter() {
    assert_eq!(fed("", true, approach, wiggle), fed("", false, approach, wiggle));
}

#[test]
fn criteria_are_the_scenarios_own() {
    let extra = "[criteria]\nposition_error_at_grasp = '2 mm'\nslosh_max = '2 deg'";
    let summary = fed(extra, true, approach, wiggle);
    let verdicts: Vec<(&str, bool)> = summary.criteria.iter().map(|c| (c.name.as_str(), c.met)).collect();
    assert_eq!(verdicts, [("position_error_at_grasp", true), ("slosh_max", false)]);
    let wide = fed("[criteria]\nposition_error_at_grasp = '2 mm'", true, approach, wiggle);
    assert!(wide.captured && Figures::from(wide.clone()).met());
    let text = wide.to_string();
    assert!(
        text.starts_with("captured\n") && text.contains("1.00 mm (at most 2.00 mm)"),
        "{text}"
    );
}

#[test]
fn a_run_that_ended_early_is_no_capture_and_says_why() {
    let mut assessment = assessment("");
    assessment.sample(1, 0.0, bytemuck(&approach(0.0)));
    assessment.sample(0, 0.0, bytemuck(&wiggle(0.0)));
    let summary = assessment.summary();
    assert!(!summary.captured);
    assert!(summary.to_string().contains("before the grasp at 0.05 s"), "{summary}");
    assert_eq!(summary.position_error_at_grasp_m, None);
}

#[test]
fn what_is_not_a_number_meets_no_criterion() {
    let broken = |t| Truth {
        position_error: f64::NAN,
        ..approach(t)
    };
    let summary = fed("[criteria]\nposition_error_at_grasp = '2 mm'", true, broken, wiggle);
    assert!(!summary.captured);
}

#[test]
fn mistakes_in_the_table_are_refused_with_their_key() {
    let refuse = |text: &str, streams: &[StreamSpec]| {
        let error = read(&toml::from_str(text).unwrap(), streams).err().unwrap();
        (error.key, error.reason)
    };
    let good = "kind = 'capture'\ngrasp_at = '30 s'\n";
    for (extra, key, part) in [
        ("truth = 'plant.lies'", "truth", "plant.truth"),
        ("truth = 'controller.command'", "truth", "`p_NB_N`"),
        ("[criteria]\nslosh_max = 3", "criteria.slosh_max", "30 deg"),
        ("[criteria]\nslosh = '3 deg'", "criteria.slosh", "unknown field"),
        ("[limits]\ntorque = '1 N'", "limits.torque", "a torque"),
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
