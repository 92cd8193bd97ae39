//! The tape is bit-identical, independently of the processes, the cores, the load and the way of waiting.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::program::{Folder, ProgramOutput, orchestrator, root, run_orchestrator, text, wait_for_output};

fn digest(scenario: &Path, out: &Path, more: &[&str]) -> String {
    let mut arguments = vec!["run", text(scenario), "--out", text(out), "--json"];
    arguments.extend(more);
    let output = run_orchestrator(&arguments);
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    output.json()["tape_digest"].as_str().expect("a digest").to_owned()
}

fn join<'a>(common: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [common, more].concat()
}

fn assert_variants_have_one_tape(scenario: &Path, folder: &Folder, common: &[&str], also_in_process: bool) {
    let out = |name: &str| folder.path().join(name);
    let first = digest(scenario, &out("first"), common);
    let mut variants: Vec<(&str, Vec<&str>)> = vec![
        ("again", join(common, &[])),
        ("spin", join(common, &["--wait", "spin"])),
        ("yield", join(common, &["--wait", "yield"])),
        ("sleep", join(common, &["--wait", "sleep"])),
        ("free", join(common, &["--no-placement"])),
    ];
    if also_in_process {
        variants.push(("in-process", join(common, &["--in-process"])));
    }
    for (name, arguments) in variants {
        assert_eq!(digest(scenario, &out(name), &arguments), first, "{name}");
    }
    // There is no core for each participant that would spin: the run reports this, and waits in another way.
    let one = on_one_core(scenario, &out("one"), &join(common, &["--wait", "spin"]));
    assert_eq!(one.json()["tape_digest"], first.as_str(), "one core");
    assert!(one.err.contains("--wait spin needs a core for each"), "{one:?}");
    let mut busy = start_load();
    assert_eq!(digest(scenario, &out("loaded"), common), first, "a loaded machine");
    for child in &mut busy {
        let _ = child.kill();
        let _ = child.wait();
    }
}

fn on_one_core(scenario: &Path, out: &Path, common: &[&str]) -> ProgramOutput {
    let mut command = Command::new("taskset");
    command
        .args(["-c", "0"])
        .arg(orchestrator())
        .args(["run", text(scenario), "--out", text(out), "--json"])
        .args(common);
    command
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    wait_for_output(command.spawn().expect("taskset is there"))
}

/// A load on every core.
fn start_load() -> Vec<std::process::Child> {
    let spin = || {
        Command::new("sh")
            .args(["-c", "while :; do :; done"])
            .spawn()
            .expect("a shell")
    };
    vec![spin(), spin(), spin()]
}

#[test]
fn small_loop_has_one_tape() {
    let folder = Folder::new("bits");
    let scenario = write_oscillator(&folder, "damper");
    assert_variants_have_one_tape(&scenario, &folder, &["--duration", "300 ms"], false);
}

#[test]
fn disrupted_loop_has_one_tape() {
    let folder = Folder::new("jitter");
    let scenario = write_oscillator(&folder, "damper");
    let common = [
        "--duration",
        "300 ms",
        "--set",
        "connections.motion.delay=7.3 ms",
        "--set",
        "connections.motion.jitter=5 ms",
        "--set",
        "connections.push.drop=0.2",
        "--set",
        "connections.push.delay=1/300 s",
        "--set",
        "connections.push.hold=initial",
        "--seed",
        "7",
    ];
    assert_variants_have_one_tape(&scenario, &folder, &common, false);
}

fn stock(name: &str) -> PathBuf {
    root().join("scenarios").join(name)
}

#[test]
fn close_capture_has_one_tape() {
    assert_variants_have_one_tape(
        &stock("close.toml"),
        &Folder::new("close"),
        &["--duration", "2 s"],
        true,
    );
}

#[test]
fn complete_close_capture_has_one_tape_in_both_ways() {
    let folder = Folder::new("whole");
    let processes = digest(&stock("close.toml"), &folder.path().join("processes"), &[]);
    let one = digest(&stock("close.toml"), &folder.path().join("one"), &["--in-process"]);
    assert_eq!(processes, one);
    let output = run_orchestrator(&[
        "compare",
        text(&folder.path().join("processes")),
        text(&folder.path().join("one")),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn far_capture_has_one_tape() {
    assert_variants_have_one_tape(&stock("far.toml"), &Folder::new("far"), &["--duration", "1 s"], true);
}
