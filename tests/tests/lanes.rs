//! Points in parallel in the lanes of a processor: tables, digests and journals equal those of points run one after the other.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use escapement_tests::machine::processes_of;
use escapement_tests::program::{Folder, ProgramOutput, run_orchestrator, start_orchestrator, text, wait_for_output};

const CLOSE: &str = "scenarios/close.toml";

/// Points that differ in everything that affects a plant's step: its masses, its start, its method and substeps, its wheels, its end. One
/// becomes non-finite, one is rejected, one captures at once, one has a brake and a fault of the samples on their way.
const CASES: &str = r#"
title = "Points of all kinds"

[[case]]
name = "as it is"

[[case]]
name = "a heavy target that is held from the first second on"
set = { "participants.plant.parameters.target.mass" = "900 kg", "participants.plant.parameters.after_grasp" = { at = '1 s', within = '100 m', within_angle = '180 deg' } }

[[case]]
name = "another method"
set = { "participants.plant.parameters.integrator.method" = "dop853" }

[[case]]
name = "substeps"
set = { "participants.plant.parameters.integrator.substeps" = 3 }

[[case]]
name = "substeps again, at another seed"
set = { "participants.plant.parameters.integrator.substeps" = 3, "seed" = 7 }

[[case]]
name = "not finite"
set = { "participants.plant.parameters.start.joint_rates" = "[1e160, 0, 0, 0, 0, 0, 0] rad/s" }

[[case]]
name = "refused"
set = { "participants.plant.parameters.integrator.substeps" = 0 }

[[case]]
name = "ends sooner"
set = { "participants.plant.parameters.start.rate" = "[1, 2, 3] deg/s", "duration" = "1.203 s" }

[[case]]
name = "a pendulum without a singular position"
set = { "participants.plant.parameters.slosh" = "spherical" }

[[case]]
name = "a stuck wheel, and a joint that locks"
actuators = [{ actuator = "wheel.y", effect = "stuck", from = "0.5 s" }, { actuator = "joint.A4", effect = "locked", from = "0.8 s" }]

[[case]]
name = "wheels that saturate"
set = { "participants.plant.parameters.actuators.wheels.start_momentum" = "[11.99, 11.99, -11.99] N m s" }

[[case]]
name = "a longer period, late samples"
set = { "participants.plant.period" = "2 ms", "connections.measured.delay" = "20 ms" }

[[case]]
name = "a fault on the way"
faults = [{ name = "encoder", at = "0.3 s", until = "1.4 s", input = "controller.measured", field = "q[3]", kind = "ramp", value = "0.1 deg/s" }]
"#;

fn sweep(out: &Path, cases: &Path, more: &[&str]) -> ProgramOutput {
    let own = [
        "faults",
        CLOSE,
        "--cases",
        text(cases),
        "--out",
        text(out),
        "--set",
        "duration=2s",
    ];
    run_orchestrator(&[&own, more].concat())
}

/// The table and the picture, and the journal without its order.
fn campaign_results(folder: &Path) -> (Vec<Vec<u8>>, Vec<String>) {
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let journal = String::from_utf8(read("results.jsonl")).unwrap();
    let mut lines: Vec<String> = journal.lines().map(String::from).collect();
    lines.sort();
    (vec![read("table.csv"), read("table.parquet")], lines)
}

#[test]
fn points_do_not_depend_on_the_number_of_lanes() {
    let folder = Folder::new("lanes");
    let cases = folder.path().join("cases.toml");
    std::fs::write(&cases, CASES).unwrap();
    for digest in [&[][..], &["--digest"]] {
        let run = |lanes: &str| {
            let out = folder.path().join(format!("{lanes}-{}", digest.len()));
            let more = [&["--workers", "1", "--lanes", lanes, "--json"], digest].concat();
            let output = sweep(&out, &cases, &more);
            assert_eq!(output.code, Some(1), "{output:?}");
            (output.json(), campaign_results(&out))
        };
        let (output, alone) = run("1");
        let outcome = |at: usize| output["rows"][at]["outcome"].as_str().unwrap().to_owned();
        assert_eq!(
            (outcome(5), outcome(6)),
            ("failed".into(), "refused".into()),
            "{output}"
        );
        for lanes in ["4", "8", "13"] {
            assert_eq!(run(lanes).1, alone, "{lanes} lanes, {digest:?}");
        }
    }
}

#[test]
fn killed_worker_loses_none_of_its_points() {
    let folder = Folder::new("lanes-killed");
    let seeds = ["--vary", "seed=1..12", "--workers", "1", "--json", "--digest"];
    let whole = folder.path().join("whole");
    let output = run_orchestrator(&[&["sweep", CLOSE, "--out", text(&whole), "--lanes", "1"], &seeds[..]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");

    let out = folder.path().join("out");
    let child = start_orchestrator(&[&["sweep", CLOSE, "--out", text(&out), "--lanes", "8"], &seeds[..]].concat());
    let started = Instant::now();
    let mut worker = String::new();
    // as soon as the first results exist, when several points are in progress again
    while worker.is_empty() || std::fs::metadata(out.join("results.jsonl")).map_or(0, |about| about.len()) == 0 {
        assert!(started.elapsed() < Duration::from_secs(120), "it never works");
        let children = std::fs::read_to_string(format!("/proc/{0}/task/{0}/children", child.id())).unwrap_or_default();
        worker = children.split_whitespace().next().unwrap_or_default().to_owned();
        std::thread::sleep(Duration::from_millis(1));
    }
    let kill = Command::new("kill")
        .args(["-KILL", &worker])
        .stderr(Stdio::null())
        .status();
    assert!(kill.unwrap().success());
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(campaign_results(&out), campaign_results(&whole));
    assert_eq!(processes_of(folder.path()), Vec::<String>::new());
}

#[test]
fn interrupted_and_sharded_campaigns_have_the_same_table() {
    let folder = Folder::new("lanes-shards");
    let out = |name: &str| folder.path().join(name);
    let vary = ["--vary", "seed=1..20", "--quiet", "--digest", "--set", "duration=5s"];
    let sweep = |name: &str, more: &[&str]| {
        run_orchestrator(&[&["sweep", CLOSE, "--out", text(&out(name))], &vary[..], more].concat())
    };
    let output = sweep("whole", &["--lanes", "1"]);
    let code = output.code;
    assert!(matches!(code, Some(0 | 1)), "{output:?}");

    let child = start_orchestrator(
        &[
            &["sweep", CLOSE, "--out", text(&out("stopped")), "--workers", "1"],
            &vary[..],
        ]
        .concat(),
    );
    let started = Instant::now();
    while std::fs::metadata(out("stopped").join("results.jsonl")).map_or(0, |about| about.len()) == 0 {
        assert!(started.elapsed() < Duration::from_secs(120), "it never works");
        std::thread::sleep(Duration::from_millis(1));
    }
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.unwrap().success());
    wait_for_output(child);
    assert_eq!(sweep("stopped", &["--lanes", "5"]).code, code);
    assert_eq!(campaign_results(&out("stopped")), campaign_results(&out("whole")));

    for (shard, lanes) in [("1/2", "8"), ("2/2", "3")] {
        let name = shard.replace('/', "-");
        assert_eq!(sweep(&name, &["--shard", shard, "--lanes", lanes]).code, code);
    }
    let merged = run_orchestrator(&[
        "sweep",
        "merge",
        text(&out("merged")),
        text(&out("1-2")),
        text(&out("2-2")),
    ]);
    assert_eq!(merged.code, code, "{merged:?}");
    let table = |name: &str| std::fs::read(out(name).join("table.csv")).unwrap();
    assert_eq!(table("merged"), table("whole"));
}
