//! Paths: relative ones resolve to the same file from every working directory, paths that are not UTF-8 work like any other, and a run
//! folder is replaced only on request.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::{send_signal, wait_for_bytes};
use escapement_tests::program::{
    Folder, ProgramOutput, built_as_shipped, copy_program, orchestrator, participant, root, run_orchestrator,
    start_orchestrator, text, wait_for_output,
};
use rustix::process::Signal;

/// Runs `orchestrator` with `arguments` in the working directory `folder`.
fn run_in_folder(folder: &Path, arguments: &[&OsStr]) -> ProgramOutput {
    let mut command = Command::new(orchestrator());
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    wait_for_output(child.expect("the orchestrator can be started"))
}

fn os<'a>(arguments: &[&'a str]) -> Vec<&'a OsStr> {
    arguments.iter().map(|argument| OsStr::new(*argument)).collect()
}

fn digest(output: &ProgramOutput) -> String {
    assert_eq!(output.code, Some(0), "{output:?}");
    output.json()["tape_digest"].as_str().unwrap().to_owned()
}

/// The oscillator with a damper started by a script in the scenario's folder: the shell gets the script's relative path.
fn write_scripted(folder: &Folder) -> PathBuf {
    folder.write("damper.sh", &format!("exec \"{}\"\n", participant("damper").display()));
    let scenario = write_oscillator(folder, "damper");
    let exe = format!("{{ exe = \"{}\" }}", participant("damper").display());
    let changed = std::fs::read_to_string(&scenario)
        .unwrap()
        .replace(&exe, "{ exe = \"sh\", args = [\"./damper.sh\"] }");
    assert!(changed.contains("damper.sh"));
    folder.write("scripted.toml", &changed.replace("10 s", "1 s"))
}

#[test]
fn scenario_and_its_plan_run_from_everywhere() {
    let folder = Folder::new("everywhere");
    let scenario = write_scripted(&folder);
    let elsewhere = Folder::new("elsewhere");
    let out = |name: &str| elsewhere.path().join(name);
    let run = |place: &Path, file: &Path, name: &str| {
        let out = out(name);
        digest(&run_in_folder(
            place,
            &os(&["run", text(file), "--json", "--out", text(&out)]),
        ))
    };
    let tape = run(Path::new("/"), &scenario, "root");
    assert_eq!(run(folder.path(), Path::new("scripted.toml"), "beside"), tape);
    assert_eq!(run(elsewhere.path(), &scenario, "third"), tape);
    // plan.toml is a scenario: it means the same wherever it is and wherever it is run.
    for (place, name) in [("root", "again"), ("beside", "once-more")] {
        assert_eq!(run(Path::new("/"), &out(place).join("plan.toml"), name), tape);
    }
    // A resumed or repeated run finds the same files.
    let saved = out("saved");
    let arguments = [
        "run",
        text(&scenario),
        "--checkpoint-at",
        "0.5 s",
        "--out",
        text(&saved),
    ];
    assert_eq!(run_in_folder(folder.path(), &os(&arguments)).code, Some(0));
    let resumed = out("resumed");
    let set = "participants.plant.run={ exe = \"sh\", args = [\"./oscillator.sh\"] }";
    folder.write(
        "oscillator.sh",
        &format!("exec \"{}\"\n", participant("oscillator").display()),
    );
    let arguments = ["resume", text(&saved), "--set", set, "--json", "--out", text(&resumed)];
    assert_eq!(digest(&run_in_folder(Path::new("/"), &os(&arguments))), tape);
    let arguments = ["replay", text(&saved), "--participant", "damper"];
    assert_eq!(run_in_folder(Path::new("/"), &os(&arguments)).code, Some(0));
    // An argument of the command itself is relative to the working directory of the command.
    std::fs::create_dir(out("bin")).unwrap();
    copy_program(&participant("damper"), &out("bin/mine"));
    let arguments = [
        "run",
        text(&scenario),
        "--substitute",
        "damper=./bin/mine",
        "--json",
        "--out",
        "mine",
    ];
    assert_eq!(digest(&run_in_folder(elsewhere.path(), &os(&arguments))), tape);
    let arguments = [
        "replay",
        text(&saved),
        "--participant",
        "damper",
        "--exe",
        "sh",
        "--",
        "./local.sh",
    ];
    copy_program(&folder.path().join("damper.sh"), &out("local.sh"));
    std::os::unix::fs::symlink("/bin/sh", out("sh")).unwrap();
    let output = run_in_folder(elsewhere.path(), &os(&arguments));
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn path_that_is_not_utf8_works_like_any_other() {
    let folder = Folder::new("bytes");
    let odd = folder.path().join(OsStr::from_bytes(b"caf\xe9"));
    std::fs::create_dir(&odd).unwrap();
    let plain = write_scripted(&folder);
    for name in ["scripted.toml", "damper.sh"] {
        copy_program(&folder.path().join(name), &odd.join(name));
    }
    let tape = digest(&run_orchestrator(&[
        "run",
        text(&plain),
        "--json",
        "--out",
        text(&folder.path().join("plain")),
    ]));
    let (scenario, out) = (odd.join("scripted.toml"), odd.join(OsStr::from_bytes(b"run\xff")));
    let (scenario, out) = (scenario.as_os_str(), out.as_os_str());
    let run_at_root = |arguments: &[&OsStr]| run_in_folder(Path::new("/"), arguments);
    let word = OsStr::new;
    let save = [word("--checkpoint-at"), word("0.5s")];
    let ran = run_at_root(&[&[word("run"), scenario, word("--json"), word("--out"), out], &save[..]].concat());
    assert_eq!(digest(&ran), tape);
    assert!(ran.err.contains("folder") && ran.err.contains("UTF-8"), "{ran:?}");
    assert_eq!(run_at_root(&[word("check"), scenario]).code, Some(0));
    let replayed = run_at_root(&[word("replay"), out, word("--participant"), word("plant")]);
    assert_eq!(replayed.code, Some(0), "{replayed:?}");
    // A sweep passes the paths to its workers.
    let swept = run_at_root(&[
        word("sweep"),
        scenario,
        word("--vary"),
        word("seed=1..2"),
        word("--json"),
        word("--digest"),
        word("--keep"),
        word("--out"),
        odd.join("sweep").as_os_str(),
    ]);
    assert_eq!(swept.code, Some(0), "{swept:?}");
    for row in swept.json()["rows"].as_array().unwrap() {
        assert_eq!(
            (&row["outcome"], &row["tape_digest"]),
            (&"complete".into(), &tape.as_str().into()),
            "{row}"
        );
    }
}

#[test]
fn sweep_over_decimal_numbers_runs_all_of_its_points() {
    built_as_shipped();
    let folder = Folder::new("decimal");
    let spring = root().join("examples/spring/spring.toml");
    let sweep = |name: &str, vary: &str| {
        let out = folder.path().join(name);
        let arguments = [
            "sweep",
            text(&spring),
            "--duration",
            "50 ms",
            "--json",
            "--vary",
            vary,
            "--out",
            text(&out),
        ];
        let output = run_orchestrator(&arguments);
        assert_eq!(output.code, Some(0), "{output:?}");
        std::fs::read_to_string(out.join("table.csv")).unwrap()
    };
    for vary in ["0..0.2:0.1", "0,1,2"] {
        sweep(vary, &format!("participants.left.parameters.position={vary}"));
    }
    let out = folder.path().join("set");
    let set = "participants.left.parameters.position=0";
    let output = run_orchestrator(&[
        "run",
        text(&spring),
        "--duration",
        "50 ms",
        "--set",
        set,
        "--out",
        text(&out),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        std::fs::read_to_string(out.join("plan.toml"))
            .unwrap()
            .contains("position = 0.0")
    );
    // Seeds with more digits than a double has are in the table unchanged.
    let table = sweep("seeds", "seed=9007199254740993..9007199254740994,9223372036854775807");
    for seed in ["9007199254740993", "9007199254740994", "9223372036854775807"] {
        assert!(
            table.lines().any(|line| line.split(',').nth(1) == Some(seed)),
            "{seed} is not in {table}"
        );
    }
    let large = sweep("large", "seed=18446744073709551614..18446744073709551615");
    assert!(
        large.contains("18446744073709551614") && large.contains("18446744073709551615"),
        "{large}"
    );
}

#[test]
fn refused_run_leaves_nothing_and_force_replaces_a_run() {
    let folder = Folder::new("force");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("runs/one");
    let run = |set: &str, more: &[&str]| {
        let arguments = [
            "run",
            text(&scenario),
            "--duration",
            "1 s",
            "--json",
            "--out",
            text(&out),
            "--set",
            set,
        ];
        run_orchestrator(&[&arguments, more].concat())
    };
    let wrong = format!(
        "participants.damper.run={{ exe = \"{}\" }}",
        participant("wrong_descriptor").display()
    );
    // The program itself must be queried: the folder exists by then.
    let output = run(&wrong, &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(!folder.path().join("runs").exists());
    let first = digest(&run("seed=1", &[]));
    let output = run("seed=2", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("not empty") && output.err.contains("--force"),
        "{output:?}"
    );
    // A rejected run does not replace an existing one, and leaves no trace in its folder.
    let names = || {
        let mut names: Vec<OsString> = std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        names
    };
    let before = names();
    let output = run(&wrong, &["--force"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert_eq!(names(), before);
    let summary = || {
        let summary = std::fs::read(out.join("summary.json")).unwrap();
        serde_json::from_slice::<serde_json::Value>(&summary).unwrap()["tape_digest"].clone()
    };
    assert_eq!(summary(), first.as_str());
    let delayed = digest(&run("connections.push.delay=5ms", &["--force"]));
    assert_ne!(delayed, first);
    assert_eq!((summary(), names()), (delayed.as_str().into(), before));
    // An input of the command is not replaced, nor is anything that is not a run.
    let arguments = [
        "replay",
        text(&out),
        "--participant",
        "damper",
        "--out",
        text(&out),
        "--force",
    ];
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert_eq!(summary(), delayed.as_str());
    std::fs::write(out.join("notes.txt"), "work of years").unwrap();
    let output = run("seed=1", &["--force"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("notes.txt") && out.join("notes.txt").exists(),
        "{output:?}"
    );
    assert_eq!(summary(), delayed.as_str());
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(folder.path()), "--force"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(scenario.exists(), "{output:?}");
}

#[test]
fn failed_run_keeps_its_folder_with_participant_logs() {
    let folder = Folder::new("died");
    let scenario = write_oscillator(&folder, "damper");
    let died = folder.path().join("died");
    let exe = format!(
        "participants.damper.run={{ exe = \"{}\" }}",
        participant("early_exit").display()
    );
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&died), "--set", &exe]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(died.join("log/damper.stderr").exists());
    let mode = std::fs::metadata(&died).unwrap().permissions().mode();
    assert_eq!(mode & 0o077, 0, "others have no part in it");
}

#[test]
fn run_that_fails_at_its_start_replaces_no_other_run() {
    let folder = Folder::new("unbegun");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("good");
    let run = |more: &[&str]| {
        let arguments = ["run", text(&scenario), "--quiet", "--out", text(&out), "--force"];
        run_orchestrator(&[&arguments, more].concat())
    };
    let output = run(&[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let read = |name: &str| std::fs::read(out.join(name)).unwrap();
    let kept = || ["plan.toml", "run.json", "summary.json", "tape/seal.json"].map(read);
    let before = kept();
    let exe = format!(
        "participants.damper.run={{ exe = \"{}\" }}",
        participant("early_exit").display()
    );
    let output = run(&["--set", &exe]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert_eq!(kept(), before);
    assert!(!out.join(".replaced").exists());
}

#[test]
fn folder_of_a_run_in_progress_is_not_taken() {
    let folder = Folder::new("progress");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("out");
    let arguments = ["run", text(&scenario), "--quiet", "--out", text(&out)];
    let mut first = start_orchestrator(&[&arguments[..], &["--real-time", "--duration", "1000 s"]].concat());
    wait_for_bytes(&mut first, &out.join("tape/plant.motion.bin"), 1);
    let second = run_orchestrator(&[&arguments[..], &["--force"]].concat());
    assert_eq!(second.code, Some(2), "{second:?}");
    assert!(second.err.contains("a run is under way in it"), "{second:?}");
    assert!(send_signal(first.id(), Signal::INT));
    let first = wait_for_output(first);
    assert!(out.join("summary.json").exists(), "{first:?}");
}
