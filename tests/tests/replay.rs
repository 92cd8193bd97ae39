//! The replay of one participant of a recorded run: equal samples, the first one that differs, and what cannot be replayed.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::processes_of;
use escapement_tests::program::{
    Folder, ProgramOutput, orchestrator, participant, root, run_orchestrator, text, wait_for_output,
};

/// Runs a scenario into `folder/run` and returns that folder.
fn recorded(folder: &Folder, scenario: &Path, more: &[&str]) -> PathBuf {
    let out = folder.path().join("run");
    let mut arguments = vec!["run", text(scenario), "--out", text(&out), "--quiet"];
    arguments.extend(more);
    let output = run_orchestrator(&arguments);
    assert!(out.join("tape/index.json").exists(), "{output:?}");
    out
}

fn replay(run: &Path, participant_name: &str, more: &[&str]) -> ProgramOutput {
    let mut arguments = vec![
        "replay",
        text(run),
        "--participant",
        participant_name,
        "--quiet",
        "--json",
    ];
    arguments.extend(more);
    run_orchestrator(&arguments)
}

/// The close capture, with every effect that a link can have on a sample.
fn capture(folder: &Folder) -> PathBuf {
    let settings = [
        "duration=3s",
        "connections.measured.delay=7ms",
        "connections.measured.jitter=9ms",
        "connections.measured.drop=0.1",
        "connections.target.hold=initial",
        "connections.target.drop=0.2",
        "connections.command.delay=1/300 s",
        "connections.setpoint.jitter=4ms",
        "participants.guidance.offset=2ms",
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|one| ["--set", one]).collect();
    recorded(folder, &root().join("scenarios/close.toml"), &settings)
}

fn identical(output: &ProgramOutput) -> u64 {
    assert_eq!(output.code, Some(0), "{output:?}");
    let result = output.json();
    assert_eq!(result["comparison"]["identical"], true, "{output:?}");
    result["comparison"]["samples"].as_u64().expect("a count")
}

/// Streams that the participant neither reads nor publishes may be recorded in part.
#[test]
fn replay_needs_only_the_streams_of_its_participant() {
    let folder = Folder::new("replay-parts");
    let run_with = |record: &str| {
        let _ = std::fs::remove_dir_all(folder.path().join("run"));
        let settings = ["--set", "duration=2s", "--set", record];
        recorded(&folder, &root().join("scenarios/close.toml"), &settings)
    };
    let refused = |run: &Path, participant_name: &str, stream: &str| {
        let output = replay(run, participant_name, &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        let reason = format!("`record` leaves out samples of `{stream}`");
        assert!(output.err.contains(&reason), "{output:?}");
    };
    let run = run_with("record.plant.truth={ every = \"10 ms\" }");
    for participant_name in ["controller", "guidance"] {
        assert!(
            identical(&replay(&run, participant_name, &[])) > 0,
            "{participant_name}"
        );
    }
    refused(&run, "plant", "plant.truth");
    let run = run_with("record.plant.target={ from = \"1 s\" }");
    assert!(identical(&replay(&run, "controller", &[])) > 0);
    refused(&run, "guidance", "plant.target");
}

#[test]
fn replay_of_every_stock_participant_is_identical() {
    let folder = Folder::new("replay");
    let run = capture(&folder);
    for (participant_name, samples) in [("controller", 900), ("guidance", 900), ("plant", 15_005)] {
        assert_eq!(
            identical(&replay(&run, participant_name, &[])),
            samples,
            "{participant_name} in this process"
        );
        assert_eq!(
            identical(&replay(&run, participant_name, &["--process"])),
            samples,
            "{participant_name} as a process"
        );
    }
    assert_eq!(identical(&replay(&run, "controller", &["--to", "1 s"])), 300);
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn changed_parameter_is_found_at_the_first_different_sample() {
    let folder = Folder::new("replay-parameter");
    let run = capture(&folder);
    let set = ["--set", "participants.guidance.parameters.schedule.start=\"1.5 s\""];
    for process in [&[][..], &["--process"]] {
        let output = replay(&run, "guidance", &[&set[..], process].concat());
        assert_eq!(output.code, Some(3), "{output:?}");
        let first = output.json()["comparison"]["first"].clone();
        // The set-point leaves its start after 1 s in one run and after 1.5 s in the other: until then the samples are equal.
        let at = first["stamp_s"].as_f64().expect("a stamp");
        assert!((1.0..1.1).contains(&at), "{first}");
        let fields = output.json()["comparison"]["fields"].clone();
        let moved = fields
            .as_array()
            .expect("fields")
            .iter()
            .find(|field| field["field"] == "guidance.setpoint.p_ND_N");
        let moved = moved.unwrap_or_else(|| panic!("{fields}"));
        assert_eq!(moved["unit"], "m");
        assert!(moved["largest"].as_f64() > Some(0.0), "{moved}");
    }
}

#[test]
fn truncated_tape_is_replayed_to_its_end() {
    let folder = Folder::new("replay-cut");
    let scenario = write_oscillator(&folder, "damper");
    let run = recorded(&folder, &scenario, &[]);
    std::fs::remove_file(run.join("tape/seal.json")).unwrap();
    let cut = |stream: &str, length: u64| {
        let file = std::fs::OpenOptions::new()
            .write(true)
            .open(run.join("tape").join(stream))
            .unwrap();
        file.set_len(length).unwrap();
    };
    // 5000 whole samples of the plant and a torn one: the last that exists is stamped 4.999 s. 300 samples of the damper.
    cut("plant.motion.bin", 24 * 5000 + 11);
    cut("damper.push.bin", 24 * 300);
    let output = replay(&run, "damper", &[]);
    assert_eq!(identical(&output), 300);
    let notes = output.json()["notes"].to_string();
    assert!(
        notes.contains("5000 samples of plant.motion") && notes.contains("t = 5 s"),
        "{notes}"
    );
    assert!(notes.contains("200 samples more than the tape"), "{notes}");
    cut("plant.motion.bin", 0);
    let output = replay(&run, "damper", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("0 samples of `plant.motion`"), "{output:?}");
}

#[test]
fn crash_is_reproduced_at_the_same_time() {
    let folder = Folder::new("replay-crash");
    let scenario = write_oscillator(&folder, "crash_at");
    let run = recorded(&folder, &scenario, &[]);
    let output = replay(&run, "damper", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("signal 6") && output.err.contains("t = 2 s"),
        "{output:?}"
    );
    assert_eq!(output.json()["comparison"]["samples"], 200, "{output:?}");
    // The healthy program in its place continues past the instant of the crash.
    let healthy = participant("damper");
    let output = replay(&run, "damper", &["--exe", text(&healthy)]);
    assert_eq!(identical(&output), 200);
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn replay_that_does_not_fit_is_refused_with_the_difference() {
    let folder = Folder::new("replay-misfit");
    let scenario = write_oscillator(&folder, "damper");
    let run = recorded(&folder, &scenario, &[]);
    let other = participant("wrong_descriptor");
    let oscillator = participant("oscillator");
    let period = "participants.plant.period=2ms";
    let cases: [(&Path, &str, &[&str], &[&str]); 6] = [
        (&run, "nobody", &[], &["no participant `nobody`", "`damper`, `plant`"]),
        (folder.path(), "damper", &[], &["plan.toml"]),
        (
            &run,
            "damper",
            &["--exe", text(&other)],
            &["damper.push", "in N,", "in kN,"],
        ),
        (
            &run,
            "damper",
            &["--exe", text(&oscillator)],
            &["input of `damper` called `motion`"],
        ),
        (
            &run,
            "damper",
            &["--set", period],
            &["2 ms", "1 ms", "participants.plant"],
        ),
        (&run, "damper", &["--to", "0 s"], &["--to"]),
    ];
    for (run, participant_name, more, words) in cases {
        let output = replay(run, participant_name, more);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            words.iter().all(|word| output.err.contains(word)),
            "{words:?}: {output:?}"
        );
    }
}

#[test]
fn stopped_replay_reports_only_the_compared_samples() {
    let folder = Folder::new("replay-stopped");
    let run = recorded(&folder, &write_oscillator(&folder, "damper"), &[]);
    // Without input the pause has no answer, and the replay is stopped there.
    let arguments = ["replay", text(&run), "-p", "damper", "--wait-for-debugger=1s"];
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("stopped at t = 1 s") && output.out.contains("up to t = 0.99 s:"),
        "{output:?}"
    );
    assert!(output.out.contains("identical: 100 samples"), "{output:?}");
    let output = run_orchestrator(&[&arguments[..], &["--json"]].concat());
    assert_eq!(output.json()["to_s"], 0.99, "{output:?}");
}

#[test]
fn replay_waits_for_a_debugger_before_the_first_step() {
    let folder = Folder::new("replay-debugger");
    let scenario = write_oscillator(&folder, "damper");
    let run = recorded(&folder, &scenario, &[]);
    let arguments = [
        "replay",
        text(&run),
        "-p",
        "damper",
        "--wait-for-debugger",
        "--to",
        "1 s",
        "--patience",
        "1 ms",
    ];
    let mut child = Command::new(orchestrator())
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    std::io::BufRead::read_line(&mut stderr, &mut line).unwrap();
    let pid = line
        .split("damper is process ")
        .nth(1)
        .and_then(|rest| rest.split([',', ')']).next());
    let pid: u32 = pid.and_then(|pid| pid.parse().ok()).unwrap_or_else(|| panic!("{line}"));
    assert!(line.contains("t = 0 s"), "{line}");
    let exe = std::fs::read_link(format!("/proc/{pid}/exe")).unwrap();
    assert_eq!(exe.file_name(), participant("damper").file_name());
    child.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(output.out.contains("identical: 100 samples"), "{output:?}");
}

/// The part before a branch was recorded with another plan: if that affects the participant, the replay is rejected; otherwise it works
/// as usual.
#[test]
fn branch_is_replayed_where_its_own_plan_made_it() {
    let folder = Folder::new("replay-branch");
    let parent = Folder::new("replay-parent");
    let run = recorded(
        &parent,
        &capture(&folder).join("plan.toml"),
        &["--duration", "1 s", "--checkpoint-at", "400 ms"],
    );
    let branch = folder.path().join("branch");
    let resume = |from: &Path, out: &Path, more: &[&str]| {
        let output = run_orchestrator(&[&["resume", text(from), "--out", text(out), "--quiet"], more].concat());
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    };
    let change = [
        "--from",
        "500 ms",
        "--set",
        "participants.guidance.parameters.schedule.start=100 ms",
    ];
    resume(&run, &branch, &[&change[..], &["--checkpoint-at", "700 ms"]].concat());
    let output = replay(&branch, "guidance", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        "resumed with changes at t = 500 ms",
        "`guidance` differs",
        "replay the run from which this one was resumed",
    ] {
        assert!(output.err.contains(part), "{output:?}");
    }
    // The control law is the same throughout, and the inputs are on the tape.
    assert!(identical(&replay(&branch, "controller", &[])) > 0);
    // The same holds for a run that continues from the branch. Where a change is requested, the difference is reported.
    let again = folder.path().join("again");
    resume(&branch, &again, &[]);
    assert_eq!(replay(&again, "guidance", &[]).code, Some(2));
    let output = replay(
        &branch,
        "guidance",
        &["--set", "participants.guidance.parameters.schedule.start=200 ms"],
    );
    assert_eq!(output.code, Some(3), "{output:?}");
}

#[test]
fn tape_that_lacks_needed_streams_is_refused_by_name() {
    let folder = Folder::new("replay-record");
    for (participant_name, what, does) in [
        ("controller", "record.plant.measured=false", "reads"),
        (
            "guidance",
            "record.guidance.setpoint={ every = \"100 ms\" }",
            "publishes",
        ),
    ] {
        let run = recorded(
            &folder,
            &root().join("scenarios/close.toml"),
            &["--duration", "300 ms", "--force", "--in-process", "--set", what],
        );
        let output = replay(&run, participant_name, &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in ["`record` leaves out samples of `", does, "record the stream whole"] {
            assert!(output.err.contains(part), "{output:?}");
        }
    }
}

#[test]
fn replay_without_a_sample_to_compare_is_no_success() {
    let folder = Folder::new("replay-nothing");
    for (set, reason) in [
        ("record.controller=false", "the tape has no output of `controller`"),
        (
            "participants.controller.offset=200 ms",
            "the tape has no sample of `controller`",
        ),
    ] {
        let run = recorded(
            &folder,
            &root().join("scenarios/close.toml"),
            &["--duration", "100 ms", "--force", "--in-process", "--set", set],
        );
        let output = replay(&run, "controller", &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        let error = format!("error: nothing was compared: {reason}");
        assert!(output.err.contains(&error), "{output:?}");
        assert!(output.json()["comparison"].is_null(), "{output:?}");
        let words = run_orchestrator(&["replay", text(&run), "--participant", "controller"]);
        assert!(!words.out.contains("identical"), "{words:?}");
    }
}
