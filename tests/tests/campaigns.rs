//! Campaigns: figures equal to those of single runs, tables that depend only on the points, and points that fail alone.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::processes_of;
use escapement_tests::program::{
    Folder, ProgramOutput, orchestrator, participant, root, run_orchestrator, start_orchestrator, text, wait_for_output,
};
use serde_json::Value;

const CLOSE: &str = "scenarios/close.toml";
const DELAYS: &str = "connections.measured.delay=0ms,10ms,60ms";

/// `sweep` of the close capture with `more`, into `out`.
fn sweep(out: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["sweep", CLOSE, "--out", text(out)], more].concat())
}

fn files(folder: &Path) -> Vec<Vec<u8>> {
    ["table.csv", "table.parquet", "figure.svg", "figure.png"]
        .iter()
        .map(|name| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}")))
        .collect()
}

/// Waits until `there`, polling every few milliseconds; fails after two minutes.
fn wait_for(mut there: impl FnMut() -> bool) {
    let started = Instant::now();
    while !there() {
        assert!(started.elapsed() < Duration::from_secs(120), "it never happens");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn run_and_sweep_give_the_same_figures_to_every_digit() {
    let folder = Folder::new("digits");
    let out = |name: &str| folder.path().join(name);
    let output = sweep(
        &out("sweep"),
        &["--vary", "connections.measured.delay=0ms,10ms", "--json", "--digest"],
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    let swept = output.json();
    let kept = sweep(
        &out("kept"),
        &["--vary", "connections.measured.delay=0ms,10ms", "--json", "--keep"],
    )
    .json();
    for (number, delay) in ["0 ms", "10 ms"].iter().enumerate() {
        let delay = format!("connections.measured.delay={delay}");
        for mode in [&[][..], &["--in-process"]] {
            let run = out(&format!("run-{number}-{}", mode.len()));
            let arguments = [&["run", CLOSE, "--json", "--set", &delay, "--out", text(&run)], mode].concat();
            let single = run_orchestrator(&arguments).json();
            let row = &swept["rows"][number];
            assert_eq!(row["tape_digest"], single["tape_digest"]);
            assert_eq!(row["outcome"], "met");
            let figures = row["figures"].as_object().unwrap();
            assert!(figures.len() > 50);
            for (name, value) in figures {
                let own = match name.split_once('[') {
                    None => single.get(name).unwrap_or(&single["measures"][name]["value"]),
                    Some((list, at)) => &single[list][at.trim_end_matches(']').parse::<usize>().unwrap()],
                };
                // whether the gripper has closed is recorded as 0 or 1
                let own = own
                    .as_bool()
                    .map_or(own.clone(), |yes| Value::from(f64::from(u8::from(yes))));
                // compared as numbers, and so bit-exactly
                assert_eq!(value.as_f64(), own.as_f64(), "{name}");
            }
        }
        assert_eq!(kept["rows"][number]["figures"], swept["rows"][number]["figures"]);
        let run = out("kept").join(format!("runs/0000{}", number + 1));
        let summary: Value = serde_json::from_slice(&std::fs::read(run.join("summary.json")).unwrap()).unwrap();
        assert_eq!(summary["tape_digest"], swept["rows"][number]["tape_digest"]);
        assert!(run.join("tape/plant.truth.bin").exists());
    }
    assert!(
        !out("sweep").join("runs").exists(),
        "tapes are not kept unless asked for"
    );
}

#[test]
fn table_does_not_depend_on_workers_or_interruptions() {
    let folder = Folder::new("workers");
    let out = |name: &str| folder.path().join(name);
    let vary = [
        "--vary",
        DELAYS,
        "--vary",
        "participants.controller.period=10ms,20ms",
        "--quiet",
    ];
    for (name, workers) in [("one", "1"), ("three", "3")] {
        let output = sweep(&out(name), &[&vary[..], &["--workers", workers]].concat());
        assert_eq!((output.code, output.out.as_str()), (Some(0), ""), "{output:?}");
    }
    assert_eq!(files(&out("one")), files(&out("three")));

    // interrupted after its first result, and once more killed outright
    let stopped = out("stopped");
    let alone = ["--workers", "1", "--lanes", "1"]; // in parallel they would all end at once
    let arguments = [&["sweep", CLOSE, "--out", text(&stopped)], &alone[..], &vary[..]].concat();
    let lines = || {
        let journal = std::fs::read(stopped.join("results.jsonl")).unwrap_or_default();
        journal.iter().filter(|byte| **byte == b'\n').count()
    };
    for (signal, code) in [("-INT", Some(1)), ("-KILL", None)] {
        let before = lines();
        let child = start_orchestrator(&arguments);
        wait_for(|| lines() > before);
        let killed = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()
            .unwrap();
        assert!(killed.success());
        let output = wait_for_output(child);
        assert_eq!(output.code, code, "{output:?}");
        assert!(lines() < 6, "it was to be stopped on the way");
    }
    wait_for(|| processes_of(&stopped).is_empty());
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(files(&stopped), files(&out("one")));
    assert_eq!(lines(), 6, "nothing was run twice");
}

#[test]
fn failed_point_is_a_row_with_its_reason() {
    let folder = Folder::new("wrong");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("sweep");
    let exe = |name: &str| format!("{{ exe = \"{}\" }}", participant(name).display());
    let vary = format!(
        "participants.damper.run={},{},{},{}",
        exe("damper"),
        exe("panics"),
        exe("crash_at"),
        "{ exe = \"/nowhere\" }"
    );
    let output = run_orchestrator(&["sweep", text(&scenario), "--out", text(&out), "--json", "--vary", &vary]);
    assert_eq!(output.code, Some(1), "{output:?}");
    let rows = output.json()["rows"].clone();
    let word = |number: usize| rows[number]["outcome"].as_str().unwrap().to_owned();
    let reason = |number: usize| rows[number]["reason"].as_str().unwrap_or_default().to_owned();
    assert_eq!(
        [word(0), word(1), word(2), word(3)],
        ["complete", "failed", "failed", "refused"]
    );
    assert!(reason(1).contains("`damper`"), "{}", reason(1));
    assert!(reason(2).contains("signal 6"), "{}", reason(2));
    assert!(reason(3).contains("/nowhere"), "{}", reason(3));
    assert_eq!(processes_of(folder.path()), Vec::<String>::new());
}

#[test]
fn killed_worker_loses_its_point_alone_which_is_run_again() {
    let folder = Folder::new("killed");
    let out = folder.path().join("sweep");
    let arguments = [
        "sweep",
        CLOSE,
        "--out",
        text(&out),
        "--workers",
        "1",
        "--lanes=1",
        "--vary",
        "seed=1..4",
        "--json",
    ];
    let child = start_orchestrator(&arguments);
    let children = format!("/proc/{0}/task/{0}/children", child.id());
    let mut worker = String::new();
    wait_for(|| {
        worker = std::fs::read_to_string(&children).unwrap_or_default().trim().to_owned();
        !worker.is_empty() && std::fs::metadata(out.join("results.jsonl")).is_ok_and(|about| about.len() > 0)
    });
    assert!(
        Command::new("kill")
            .args(["-KILL", &worker])
            .stderr(Stdio::null())
            .status()
            .unwrap()
            .success()
    );
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    let json = output.json();
    assert_eq!((json["met"].as_u64(), json["crashed"].as_u64()), (Some(3), Some(1)));
    let crashed = json["rows"]
        .as_array()
        .unwrap()
        .iter()
        .find(|row| row["outcome"] == "crashed")
        .unwrap();
    assert!(
        crashed["reason"].as_str().unwrap().contains("signal 9 (killed)"),
        "{crashed}"
    );
    let again = run_orchestrator(&arguments);
    assert_eq!((again.code, again.json()["met"].as_u64()), (Some(0), Some(4)));
}

#[test]
fn scenario_edited_during_a_campaign_ends_the_campaign() {
    let folder = Folder::new("edited");
    let out = folder.path().join("sweep");
    let stock = std::fs::read_to_string(root().join(CLOSE)).unwrap();
    let stock = stock.replace("../", &format!("{}/", root().display()));
    let scenario = folder.write("own.toml", &stock);
    let arguments = [
        "sweep",
        text(&scenario),
        "--out",
        text(&out),
        "--workers",
        "1",
        "--vary",
        "seed=1..500",
    ];
    let child = start_orchestrator(&arguments);
    wait_for(|| std::fs::metadata(out.join("results.jsonl")).is_ok_and(|about| about.len() > 0));
    folder.write("own.toml", &stock.replacen("duration = ", "duration = \"1 s\" # ", 1));
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    let reason = "own.toml has changed since the campaign began: start it again";
    assert!(output.err.contains(reason), "{output:?}");
    assert_eq!(processes_of(&out), Vec::<String>::new());
}

#[test]
fn invalid_grid_is_refused_before_any_run() {
    let folder = Folder::new("refused-grid");
    let out = folder.path().join("sweep");
    for (more, parts) in [
        (
            &["--vary", "connections.measured.dealy=1ms"][..],
            ["dealy", "unknown field"],
        ),
        (
            &["--vary", "participants.controler.period=1ms"],
            ["controler", "there is `controller`"],
        ),
        (
            &["--vary", "participants.plant.parameters.spede=1"],
            ["parameters.spede", "unknown field"],
        ),
        (
            &["--vary", "seed=1..1000", "--vary", "duration=1s..1000s:1s"],
            ["1000 x 1000", "vary less"],
        ),
        (
            &["--vary", "connections.measured.delay=1ms..0ms:1ms"],
            ["1ms..0ms", "never gets to its end"],
        ),
        (&["--vary", "connections.measured.delay="], ["empty value", "5ms,10ms"]),
        (&[], ["--vary", "what to vary"]),
        (&["--vary", "seed=1,2", "--seed", "3"], ["seed", "vary it or fix it"]),
        (
            &["--vary", "seed=1,2", "--figure", "beauty"],
            ["`beauty`", "position_error_at_grasp"],
        ),
    ] {
        let output = sweep(&out, more);
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in parts {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
        assert_eq!(output.err.matches("error:").count(), 1, "{}", output.err);
        assert!(!out.exists(), "nothing is written");
    }
}

#[test]
fn folder_of_another_campaign_is_left_unchanged() {
    let folder = Folder::new("taken");
    let out = folder.path().join("sweep");
    let vary = ["--vary", "seed=1,2", "--duration", "1 s", "--quiet"];
    assert_eq!(sweep(&out, &vary).code, Some(0));
    let before = files(&out);
    let output = sweep(&out, &["--vary", "seed=1,3", "--duration", "1 s"]);
    assert_eq!(output.code, Some(2));
    assert!(
        output.err.contains("another campaign") && output.err.contains("--out"),
        "{output:?}"
    );
    assert_eq!(files(&out), before);
    let output = sweep(&root().join("docs"), &vary);
    assert_eq!(output.code, Some(2));
    assert!(output.err.contains("no campaign's"), "{output:?}");
}

#[test]
fn every_failure_of_an_actuator_is_a_case() {
    let folder = Folder::new("actuators");
    let out = folder.path().join("faults");
    // long enough to plan and start; what becomes of each is for the page
    let arguments = [
        "faults",
        CLOSE,
        "--duration",
        "20 ms",
        "--at",
        "10ms",
        "--informed",
        "--quiet",
        "--out",
    ];
    let output = run_orchestrator(&[&arguments[..], &[text(&out)]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let table = std::fs::read_to_string(out.join("table.csv")).unwrap();
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    assert_eq!(
        lines.next().unwrap()[1..5],
        ["actuator", "effect", "from", "law informed"]
    );
    let rows: Vec<Vec<&str>> = lines.collect();
    let count = |actuator: &str, effect: &str| {
        let matches = |row: &&Vec<&str>| row[1].starts_with(actuator) && row[2] == effect && row[4] == "no";
        rows.iter().filter(matches).count()
    };
    assert_eq!(
        (count("none", ""), count("wheel.", "stuck"), count("wheel.", "half")),
        (1, 6, 6)
    );
    // twelve thrusters and six directions, each from the start and later
    assert_eq!((count("thruster.", "off"), count("thruster.", "on")), (36, 36));
    assert_eq!((count("joint.", "locked"), count("joint.", "off")), (14, 14));
    assert_eq!(rows.iter().filter(|row| row[4] == "yes").count(), 6 + 14);
}

#[test]
fn case_list_applies_its_changes() {
    let folder = Folder::new("cases");
    let list = folder.write(
        "cases.toml",
        r#"
[[case]]
name = "healthy"

[[case]]
name = "wheel y off, arm twice as heavy in the law's eyes"
actuators = [{ actuator = "wheel.y", effect = "off" }]
set = { "participants.controller.parameters.model.mass_factor" = 2.0 }

[[case]]
name = "late"
set = { "connections.measured.delay" = "200 ms" }
append = { "participants.plant.parameters.faults" = [{ actuator = "joint.A1", effect = "locked", from = "2 s" }] }
"#,
    );
    let out = folder.path().join("faults");
    let how = ["--json", "--digest", "--out", text(&out)];
    let output = run_orchestrator(&[&["faults", CLOSE, "--cases", text(&list)][..], &how].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let json = output.json();
    assert_eq!(json["rows"][0]["outcome"], "met");
    // the table has the settings of each case, by key
    let values = |row: usize, key: &str| json["rows"][row]["values"][key].as_str().unwrap_or_default().to_owned();
    assert_eq!(values(2, "connections.measured.delay"), "200 ms");
    assert_eq!(values(1, "participants.controller.parameters.model.mass_factor"), "2.0");
    assert!(values(1, "actuators").contains("wheel.y") && values(1, "connections.measured.delay").is_empty());
    for number in [1, 2] {
        let row = &json["rows"][number];
        assert_eq!(row["outcome"], "not-met", "{row}");
        assert_ne!(row["tape_digest"], json["rows"][0]["tape_digest"]);
    }
}

#[test]
fn case_list_injects_faults_and_substitutes() {
    let folder = Folder::new("cases-faults");
    let scenario = write_oscillator(&folder, "damper");
    let exe = |name: &str| participant(name).display().to_string();
    let list = format!(
        r#"[[case]]
name = "healthy"

[[case]]
name = "biased"
faults = [{{ at = "2 s", until = "3 s", input = "damper.motion", field = "velocity", kind = "bias", value = "1 m/s" }}]

[[case]]
name = "another with the state of the one before"
faults = [{{ at = "4 s", substitute = "damper", run = {{ exe = {:?} }}, state = "keep" }}]

[[case]]
name = "two at once"
faults = [
    {{ at = "2 s", until = "3 s", input = "damper.motion", field = "velocity", kind = "bias", value = "1 m/s" }},
    {{ at = "4 s", substitute = "damper", run = {{ exe = {:?} }}, state = "keep" }},
]

[[case]]
name = "one that fails"
faults = [{{ at = "1 s", substitute = "damper", run = {{ exe = {:?} }} }}]

[[case]]
name = "a guard"
set = {{ "guards.weak" = {{ output = "damper.push", field = "force", range = "[-1, 1] mN" }} }}
"#,
        exe("damper"),
        exe("damper"),
        exe("crash_at")
    );
    let list = folder.write("cases.toml", &list);
    let out = folder.path().join("faults");
    let output = run_orchestrator(&[
        "faults",
        text(&scenario),
        "--cases",
        text(&list),
        "--json",
        "--digest",
        "--keep",
        "--out",
        text(&out),
    ]);
    assert_eq!(output.code, Some(1), "one fails: {output:?}");
    let points = output.json()["rows"].as_array().expect("a list of rows").clone();
    let column = |name: &str| -> Vec<String> {
        let texts = points
            .iter()
            .map(|point| point[name].as_str().unwrap_or_default().to_owned());
        texts.collect()
    };
    assert_eq!(
        column("outcome"),
        ["complete", "complete", "complete", "complete", "failed", "failed"],
        "{points:?}"
    );
    // A case has the effect of a run with the same faults: the first differs from the healthy run, a substitute that keeps the state does
    // not, and both together equal the first.
    let digests = column("tape_digest");
    assert_ne!(digests[1], digests[0]);
    assert_eq!(digests[2], digests[0]);
    // The tape of a disturbed run has the stream of the samples seen, whichever program runs.
    assert_eq!(digests[3], digests[1]);
    let reasons = column("reason");
    assert!(reasons[4].contains("signal 6 (abort) at t = 2 s"), "{reasons:?}");
    assert!(reasons[5].contains("guard `weak`"), "{reasons:?}");
    assert!(out.join("runs/00003/tape/events.jsonl").is_file());
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn campaign_folder_is_used_by_one_program_at_a_time() {
    let folder = Folder::new("beside");
    let out = folder.path().join("sweep");
    let arguments = ["sweep", CLOSE, "--out", text(&out), "--vary", "seed=1..1000", "--quiet"];
    let mut first = Command::new(orchestrator())
        .args(arguments)
        .current_dir(root())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_for(|| std::fs::metadata(out.join("results.jsonl")).is_ok_and(|about| about.len() > 0));
    let second = run_orchestrator(&arguments);
    first.kill().unwrap();
    first.wait().unwrap();
    assert_eq!(second.code, Some(2));
    assert!(second.err.contains("being worked in"), "{second:?}");
}
