//! A user's program has the whole command line, with the user's participants built in.

use std::process::Command;

use escapement_tests::program::{Folder, built, root, text};

/// The lander's program with `arguments`: its exit code, and what it printed.
fn lander(arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(built().join("lander"))
        .current_dir(root())
        .args(arguments)
        .output()
        .expect("the program can be started");
    let printed = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8_lossy(&printed).into_owned())
}

const SCENARIO: &str = "examples/lander/lander.toml";

#[test]
fn own_participants_give_one_tape_in_every_way_and_resumed() {
    let folder = Folder::new("lander");
    let path = |name: &str| folder.path().join(name);
    let (apart, whole, resumed) = (path("apart"), path("whole"), path("resumed"));
    let run = lander(&[
        "run",
        SCENARIO,
        "--out",
        text(&apart),
        "--checkpoint-at",
        "20s",
        "--quiet",
    ]);
    assert_eq!(run.0, Some(0), "{}", run.1);
    let run = lander(&["run", SCENARIO, "--out", text(&whole), "--in-process", "--quiet"]);
    assert_eq!(run.0, Some(0), "{}", run.1);
    let run = lander(&["resume", text(&apart), "--out", text(&resumed), "--quiet"]);
    assert_eq!(run.0, Some(0), "{}", run.1);
    for other in [&whole, &resumed] {
        let (code, output) = lander(&["compare", text(&apart), text(other)]);
        assert_eq!(code, Some(0), "{output}");
    }
}

#[test]
fn own_participants_run_in_a_campaign() {
    let folder = Folder::new("lander-sweep");
    let out = folder.path().join("sweep");
    let vary = "participants.autopilot.period=20ms,50ms,100ms";
    let (code, output) = lander(&["sweep", SCENARIO, "--vary", vary, "--out", text(&out), "--quiet"]);
    assert_eq!(code, Some(0), "{output}");
    let table = std::fs::read_to_string(out.join("table.csv")).expect("a campaign has a table");
    assert_eq!(table.lines().count(), 4, "{table}");
    assert_eq!(table.matches(",met,").count(), 3, "{table}");
}

#[test]
fn own_program_lists_its_participants() {
    let (code, output) = lander(&["run", "scenarios/close.toml"]);
    assert_eq!(code, Some(2), "{output}");
    assert!(
        output.contains("there is no builtin `plant`; there is `autopilot`, `lander`"),
        "{output}"
    );
    let (code, output) = lander(&["faults", SCENARIO]);
    assert_eq!(code, Some(2), "{output}");
    assert!(output.contains("give it with --cases"), "{output}");
}
