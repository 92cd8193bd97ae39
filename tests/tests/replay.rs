//! The replay of one participant of a recorded run: equal samples, the first one that differs, and what cannot be replayed.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use escapement_tests::machine::processes_of;
use escapement_tests::program::{Folder, Said, finish, orchestrate, orchestrator, participant, root, text};
use escapement_tests::world::oscillator;

/// Runs a scenario into `folder/run` and returns that folder.
fn recorded(folder: &Folder, scenario: &Path, more: &[&str]) -> PathBuf {
    let out = folder.path().join("run");
    let mut arguments = vec!["run", text(scenario), "--out", text(&out), "--quiet"];
    arguments.extend(more);
    let said = orchestrate(&arguments);
    assert!(out.join("tape/index.json").exists(), "{said:?}");
    out
}

fn replay(run: &Path, who: &str, more: &[&str]) -> Said {
    let mut arguments = vec!["replay", text(run), "--participant", who, "--quiet", "--json"];
    arguments.extend(more);
    orchestrate(&arguments)
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

fn identical(said: &Said) -> u64 {
    assert_eq!(said.code, Some(0), "{said:?}");
    let result = said.json();
    assert_eq!(result["comparison"]["identical"], true, "{said:?}");
    result["comparison"]["samples"].as_u64().expect("a count")
}

#[test]
fn replay_of_every_stock_participant_is_identical() {
    let folder = Folder::new("replay");
    let run = capture(&folder);
    for (who, samples) in [("controller", 900), ("guidance", 900), ("plant", 15_005)] {
        assert_eq!(identical(&replay(&run, who, &[])), samples, "{who} in this process");
        assert_eq!(
            identical(&replay(&run, who, &["--process"])),
            samples,
            "{who} as a process"
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
        let said = replay(&run, "guidance", &[&set[..], process].concat());
        assert_eq!(said.code, Some(3), "{said:?}");
        let first = said.json()["comparison"]["first"].clone();
        // The set-point leaves its start after 1 s in one run and after 1.5 s in the other: until then the samples are equal.
        let at = first["stamp_s"].as_f64().expect("a stamp");
        assert!((1.0..1.1).contains(&at), "{first}");
        let fields = said.json()["comparison"]["fields"].clone();
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
    let scenario = oscillator(&folder, "damper");
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
    let said = replay(&run, "damper", &[]);
    assert_eq!(identical(&said), 300);
    let notes = said.json()["notes"].to_string();
    assert!(
        notes.contains("5000 samples of plant.motion") && notes.contains("t = 5 s"),
        "{notes}"
    );
    assert!(notes.contains("200 samples more than the tape"), "{notes}");
    cut("plant.motion.bin", 0);
    let said = replay(&run, "damper", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("0 samples of `plant.motion`"), "{said:?}");
}

#[test]
fn crash_is_reproduced_at_the_same_time() {
    let folder = Folder::new("replay-crash");
    let scenario = oscillator(&folder, "crash_at");
    let run = recorded(&folder, &scenario, &[]);
    let said = replay(&run, "damper", &[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("signal 6") && said.err.contains("t = 2 s"),
        "{said:?}"
    );
    assert_eq!(said.json()["comparison"]["samples"], 200, "{said:?}");
    // The healthy program in its place continues past the instant of the crash.
    let healthy = participant("damper");
    let said = replay(&run, "damper", &["--exe", text(&healthy)]);
    assert_eq!(identical(&said), 200);
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn replay_that_does_not_fit_is_refused_with_the_difference() {
    let folder = Folder::new("replay-misfit");
    let scenario = oscillator(&folder, "damper");
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
    for (run, who, more, words) in cases {
        let said = replay(run, who, more);
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(words.iter().all(|word| said.err.contains(word)), "{words:?}: {said:?}");
    }
}

#[test]
fn stopped_replay_reports_only_the_compared_samples() {
    let folder = Folder::new("replay-stopped");
    let run = recorded(&folder, &oscillator(&folder, "damper"), &[]);
    // Without input the pause has no answer, and the replay is stopped there.
    let arguments = ["replay", text(&run), "-p", "damper", "--wait-for-debugger=1s"];
    let said = orchestrate(&arguments);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("stopped at t = 1 s") && said.out.contains("up to t = 0.99 s:"),
        "{said:?}"
    );
    assert!(said.out.contains("identical: 100 samples"), "{said:?}");
    let said = orchestrate(&[&arguments[..], &["--json"]].concat());
    assert_eq!(said.json()["to_s"], 0.99, "{said:?}");
}

#[test]
fn replay_waits_for_a_debugger_before_the_first_step() {
    let folder = Folder::new("replay-debugger");
    let scenario = oscillator(&folder, "damper");
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
    let mut said = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    std::io::BufRead::read_line(&mut said, &mut line).unwrap();
    let pid = line
        .split("damper is process ")
        .nth(1)
        .and_then(|rest| rest.split([',', ')']).next());
    let pid: u32 = pid.and_then(|pid| pid.parse().ok()).unwrap_or_else(|| panic!("{line}"));
    assert!(line.contains("t = 0 s"), "{line}");
    let exe = std::fs::read_link(format!("/proc/{pid}/exe")).unwrap();
    assert_eq!(exe.file_name(), participant("damper").file_name());
    child.stdin.as_mut().unwrap().write_all(b"\n").unwrap();
    let said = finish(child);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("identical: 100 samples"), "{said:?}");
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
        let said = orchestrate(&[&["resume", text(from), "--out", text(out), "--quiet"], more].concat());
        assert!(matches!(said.code, Some(0 | 3)), "{said:?}");
    };
    let change = [
        "--from",
        "500 ms",
        "--set",
        "participants.guidance.parameters.schedule.start=100 ms",
    ];
    resume(&run, &branch, &[&change[..], &["--checkpoint-at", "700 ms"]].concat());
    let said = replay(&branch, "guidance", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    for part in [
        "resumed with changes at t = 500 ms",
        "`guidance` differs",
        "replay the run from which this one was resumed",
    ] {
        assert!(said.err.contains(part), "{said:?}");
    }
    // The control law is the same throughout, and the inputs are on the tape.
    assert!(identical(&replay(&branch, "controller", &[])) > 0);
    // The same holds for a run that continues from the branch. Where a change is requested, the difference is reported.
    let again = folder.path().join("again");
    resume(&branch, &again, &[]);
    assert_eq!(replay(&again, "guidance", &[]).code, Some(2));
    let said = replay(
        &branch,
        "guidance",
        &["--set", "participants.guidance.parameters.schedule.start=200 ms"],
    );
    assert_eq!(said.code, Some(3), "{said:?}");
}

#[test]
fn tape_that_lacks_needed_streams_is_refused_by_name() {
    let folder = Folder::new("replay-record");
    for (who, what, does) in [
        ("controller", "record.plant.measured=false", "reads"),
        ("guidance", "record.guidance.setpoint={ every = \"100 ms\" }", "says"),
    ] {
        let run = recorded(
            &folder,
            &root().join("scenarios/close.toml"),
            &["--duration", "300 ms", "--force", "--in-process", "--set", what],
        );
        let said = replay(&run, who, &[]);
        assert_eq!(said.code, Some(2), "{said:?}");
        for part in ["`record` leaves out samples of `", does, "record the stream whole"] {
            assert!(said.err.contains(part), "{said:?}");
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
        let said = replay(&run, "controller", &[]);
        assert_eq!(said.code, Some(2), "{said:?}");
        let error = format!("error: nothing was compared: {reason}");
        assert!(said.err.contains(&error), "{said:?}");
        assert!(said.json()["comparison"].is_null(), "{said:?}");
        let words = orchestrate(&["replay", text(&run), "--participant", "controller"]);
        assert!(!words.out.contains("identical"), "{words:?}");
    }
}
