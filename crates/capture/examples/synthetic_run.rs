//! Records a run folder by hand, without an orchestrator: the tape is a plain library.
//!
//! A servicer with a seven-joint arm moves its tool to the grasp point of a tumbling target in 30 s. Nothing is
//! simulated: poses are prescribed curves that look like a capture, so that exports and reports have something to show.
//!
//! ```text
//! cargo run --release -p capture --example synthetic_run -- FOLDER [SECONDS [FLAVOUR]]
//! ```

#![allow(
    non_snake_case,
    reason = "fields carry the frames of the monogram notation in their names"
)]

use std::path::Path;

use lockstep::port::Message;
use lockstep::time::Rational;
use tape::folder::RunFolder;
use tape::{Event, EventKind, StreamSpec, Writer};

lockstep::message! {
    /// The true state of the plant.
    struct Truth {
        p_NB_N: [f64; 3] = "m" in "N",
        quat_NB: [f64; 4] = "1" in "N",
        q: [f64; 7] = "rad",
        q_slosh: [f64; 2] = "rad",
        omega_NB_B: [f64; 3] = "rad/s" in "B",
        v_NB_B: [f64; 3] = "m/s" in "B",
        p_NE_N: [f64; 3] = "m" in "N",
        quat_NE: [f64; 4] = "1" in "N",
        p_NG_N: [f64; 3] = "m" in "N",
        quat_NG: [f64; 4] = "1" in "N",
        base_torque: [f64; 3] = "N m" in "B",
        base_force: [f64; 3] = "N" in "B",
        joint_torque: [f64; 7] = "N m",
        momentum_angular_N: [f64; 3] = "N m s" in "N",
        energy: f64 = "J",
    }
}
lockstep::message! {
    /// The satellite to be captured.
    struct Target {
        p_NT_N: [f64; 3] = "m" in "N",
        quat_NT: [f64; 4] = "1" in "N",
    }
}
lockstep::message! {
    /// The set-point of the end effector.
    struct Setpoint {
        p_ND_N: [f64; 3] = "m" in "N",
        quat_ND: [f64; 4] = "1" in "N",
    }
}
lockstep::message! {
    /// The commands to the actuators.
    struct Command {
        base_torque: [f64; 3] = "N m" in "B",
        base_force: [f64; 3] = "N" in "B",
        joint_torque: [f64; 7] = "N m",
    }
}
lockstep::message! {
    /// Internal signals of the controller.
    struct Telemetry {
        epsilon: f64 = "1",
        h: f64 = "1",
        sigma: [f64; 13] = "1",
        saturated: [u8; 16] = "1",
    }
}

type Vec3 = [f64; 3];
type Quat = [f64; 4];

fn product(a: Quat, b: Quat) -> Quat {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn conjugate(q: Quat) -> Quat {
    [q[0], -q[1], -q[2], -q[3]]
}

fn axis_angle(axis: Vec3, angle: f64) -> Quat {
    let (s, c) = (angle / 2.0).sin_cos();
    [c, s * axis[0], s * axis[1], s * axis[2]]
}

fn rotate(q: Quat, v: Vec3) -> Vec3 {
    let [_, x, y, z] = product(product(q, [0.0, v[0], v[1], v[2]]), conjugate(q));
    [x, y, z]
}

fn add(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] + b[i])
}

/// The pose of the end effector in the base: an arm with seven joints, and the tool.
fn end_effector_pose(q: &[f64; 7]) -> (Vec3, Quat) {
    const LINKS: [(Vec3, Vec3); 7] = [
        ([0.35, 0.0, 0.6475], [0.0, 0.0, 1.0]),
        ([0.0, -0.01, 0.2125], [0.0, 1.0, 0.0]),
        ([0.0, 0.01, 0.228], [0.0, 0.0, 1.0]),
        ([0.0, 0.0105, 0.192], [0.0, -1.0, 0.0]),
        ([0.0, -0.0105, 0.2075], [0.0, 0.0, 1.0]),
        ([0.0, -0.0707, 0.1925], [0.0, 1.0, 0.0]),
        ([0.0, 0.0707, 0.091], [0.0, 0.0, 1.0]),
    ];
    let (mut p, mut r) = ([0.0; 3], [1.0, 0.0, 0.0, 0.0]);
    for ((offset, axis), angle) in LINKS.into_iter().zip(q) {
        p = add(p, rotate(r, offset));
        r = product(r, axis_angle(axis, *angle));
    }
    (add(p, rotate(r, [0.0, 0.0, 0.235])), r)
}

/// 0 below zero, 1 above one, with two continuous derivatives between.
fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

struct Instant {
    truth: Truth,
    target: Target,
    setpoint: Setpoint,
    command: Command,
    telemetry: Telemetry,
}

/// Everything at `t` seconds. `flavour` shifts the curves a little, so that two runs can be told apart.
fn instant(t: f64, flavour: f64) -> Instant {
    let rate = 1.16_f64.to_radians();
    let quat_nt = axis_angle([0.26, 0.43, 0.8635], rate * t);
    let p_ng = rotate(quat_nt, [0.0, 0.0, -0.65]);
    let s = smoothstep((t - 1.0) / 29.0);
    let shake = 0.02 * flavour * (1.1 * t).sin() * (1.0 - s);
    let error = [
        0.28 * (1.0 - s) + shake,
        0.05 * (1.0 - s) * (0.3 * t).sin(),
        -0.75 * (1.0 - s),
    ];
    let p_ne = add(p_ng, add(error, [1e-4 * (2.0 * t).sin(), 0.0, 5e-5]));
    let lag = (1.0 - smoothstep((t - 1.0) / 19.0)) * 0.35;
    let quat_ne = product(quat_nt, axis_angle([0.0, 1.0, 0.0], -lag + 3e-5 * (3.0 * t).cos()));
    let mut q = [0.0, 40.0, 0.0, 80.0, 0.0, 40.0, 0.0].map(f64::to_radians);
    for (i, angle) in q.iter_mut().enumerate() {
        *angle += s * [0.25, -0.3, 0.2, -0.35, 0.3, 0.12, 0.4][i] * (1.0 + 0.3 * flavour);
    }
    let (p_be, quat_be) = end_effector_pose(&q);
    let quat_nb = product(quat_ne, conjugate(quat_be));
    let p_nb = add(p_ne, rotate(quat_nb, p_be).map(|x| -x));
    let speed_profile = 30.0 * s * (1.0 - s);
    let force = [
        0.11 * speed_profile,
        0.02 * (0.4 * t).sin() * speed_profile,
        0.12 * speed_profile * (0.2 * t).cos(),
    ];
    let torque = [0.004, 0.009, 0.003].map(|a| a * speed_profile * (0.35 * t + 40.0 * a).cos() * (1.0 + 2.0 * flavour));
    let joint: [f64; 7] =
        std::array::from_fn(|i| (1.5 - 0.2 * i as f64) * 0.1 * speed_profile * (0.25 * t + i as f64).sin());
    let swing = (-t / 60.0).exp();
    Instant {
        truth: Truth {
            p_NB_N: p_nb,
            quat_NB: quat_nb,
            q,
            q_slosh: [0.2 * swing * (0.5 * t).sin(), 0.06 * swing * (0.45 * t).cos()],
            omega_NB_B: [rate * 0.26, rate * 0.43, rate * 0.86],
            v_NB_B: force.map(|f| f * 0.01),
            p_NE_N: p_ne,
            quat_NE: quat_ne,
            p_NG_N: p_ng,
            quat_NG: quat_nt,
            base_torque: torque,
            base_force: force,
            joint_torque: joint,
            momentum_angular_N: torque.map(|x| 8.0 * x),
            energy: 0.3 * speed_profile * speed_profile,
        },
        target: Target {
            p_NT_N: [0.0; 3],
            quat_NT: quat_nt,
        },
        setpoint: Setpoint {
            p_ND_N: add(p_ng, error),
            quat_ND: quat_ne,
        },
        command: Command {
            base_torque: torque.map(|x| 1.02 * x),
            base_force: force,
            joint_torque: joint,
        },
        telemetry: Telemetry {
            epsilon: 100.0 - 62.0 * (1.0 - s),
            h: if t < 4.0 { -1.0 } else { 1.0 },
            sigma: std::array::from_fn(|i| 0.01 * (0.2 * t + i as f64).sin() * speed_profile),
            saturated: std::array::from_fn(|i| u8::from(i == 1 && torque[1].abs() > 0.065)),
        },
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = arguments
        .first()
        .ok_or("usage: synthetic_run FOLDER [SECONDS [FLAVOUR]]")?;
    let seconds: u64 = arguments.get(1).map_or(Ok(35), |text| text.parse())?;
    let flavour: f64 = arguments.get(2).map_or(Ok(0.0), |text| text.parse())?;

    let run = RunFolder::create(Path::new(folder))?;
    let stream = |participant: &str, port: &str, descriptor, millis| {
        StreamSpec::new(
            participant,
            port,
            descriptor,
            Rational::ZERO,
            Rational::from_millis(millis),
        )
    };
    let mut writer = Writer::create(
        &run.tape(),
        vec![
            stream("plant", "truth", Truth::descriptor(), 1),
            stream("plant", "target", Target::descriptor(), 1),
            stream("guidance", "setpoint", Setpoint::descriptor(), 10),
            stream("controller", "command", Command::descriptor(), 10),
            stream("controller", "telemetry", Telemetry::descriptor(), 10),
        ],
    )?;
    for k in 0..=1000 * seconds {
        let t = k as f64 / 1000.0;
        let now = instant(t, flavour);
        writer.append(0, k, t, bytemuck::bytes_of(&now.truth))?;
        writer.append(1, k, t, bytemuck::bytes_of(&now.target))?;
        if k % 10 == 0 {
            writer.append(2, k / 10, t, bytemuck::bytes_of(&now.setpoint))?;
            writer.append(3, k / 10, t, bytemuck::bytes_of(&now.command))?;
            writer.append(4, k / 10, t, bytemuck::bytes_of(&now.telemetry))?;
        }
    }
    writer.event(&Event {
        time: Rational::from_millis(12_000),
        kind: EventKind::Note,
        participant: Some("controller".into()),
        text: "halfway".into(),
    })?;
    let digest = writer.finish()?;
    run.write_json(
        &run.run(),
        &serde_json::json!({ "scenario": "synthetic", "tape_digest": digest }),
    )?;
    run.write_json(
        &run.summary(),
        &serde_json::json!({
            "captured": true,
            "measures": {
                "position_error_at_grasp": { "value": 0.11, "unit": "mm" },
                "attitude_error_at_grasp": { "value": 0.0017, "unit": "deg" },
                "relative_speed_at_grasp": { "value": 0.2, "unit": "mm/s" },
            },
            "peak_base_torque_n_m": 0.069 * (1.0 + 2.0 * flavour),
            "saturated_fraction": 0.0,
            "tape_digest": digest,
        }),
    )?;
    println!("{digest}");
    Ok(())
}
