//! A shadow, which runs a second program on a participant's inputs: its outputs are compared, without any effect on the run.

use escapement_tests::fixture::write_oscillator;
use escapement_tests::program::{Folder, ProgramOutput, participant, root, run_orchestrator, text};

/// Runs the oscillator with its damper and the shadow `shadow`.
fn run_with_shadow(folder: &Folder, shadow: &str) -> ProgramOutput {
    let scenario = write_oscillator(folder, "damper");
    let (out, shadow) = (
        folder.path().join("run"),
        format!("damper={}", participant(shadow).display()),
    );
    run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&out),
        "--json",
        "--shadow",
        &shadow,
    ])
}

#[test]
fn shadow_of_the_same_program_is_identical() {
    let folder = Folder::new("same");
    let output = run_with_shadow(&folder, "damper");
    assert_eq!(output.code, Some(0), "{output:?}");
    let shadow = &output.json()["shadows"][0];
    assert_eq!(shadow["participant"], "damper");
    assert_eq!(shadow["comparison"]["identical"], true, "{shadow}");
    assert_eq!(shadow["comparison"]["samples"], 1000);
    assert_eq!(shadow["ending"]["status"], "complete");
    let summary = std::fs::read_to_string(folder.path().join("run/summary.json")).unwrap();
    assert!(summary.contains("\"shadows\""));
}

#[test]
fn first_and_largest_difference_of_each_field_are_reported() {
    let folder = Folder::new("other");
    let scenario = root().join("scenarios/close-start-gains.toml");
    let run = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let common = ["run", text(&scenario), "--duration", "3 s", "--out", text(&out)];
        let output = run_orchestrator(&[&common[..], more].concat());
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
        output
    };
    let shadow = [
        "--shadow",
        "controller=builtin:controller",
        "--shadow-set",
        "gains.kp.base_rotation=20 N m s/rad",
    ];
    let plain = run("plain", &["--json"]).json();
    let processes = run("processes", &[&shadow[..], &["--json"]].concat()).json();
    let in_process = run("in-process", &[&shadow[..], &["--json", "--in-process"]].concat()).json();
    assert_eq!(processes["tape_digest"], plain["tape_digest"], "a shadow has no effect");
    assert_eq!(processes["shadows"], in_process["shadows"]);
    let found = &processes["shadows"][0];
    assert_eq!(found["comparison"]["identical"], false, "{found}");
    assert!(
        found["comparison"]["first"]["stream"]
            .as_str()
            .unwrap()
            .starts_with("controller.")
    );
    assert!(!found["comparison"]["fields"].as_array().unwrap().is_empty());
    assert!(
        folder
            .path()
            .join("processes/shadow/controller/tape/controller.command.bin")
            .is_file()
    );
    let words = run("words", &[&shadow[..], &["--in-process"]].concat()).out;
    for part in [
        "shadow of `controller`, builtin:controller",
        "first at",
        "controller.",
        "largest difference",
    ] {
        assert!(words.contains(part), "`{part}` is not in: {words}");
    }
}

#[test]
fn shadow_without_a_sample_to_compare_is_not_identical() {
    let folder = Folder::new("nothing");
    let (scenario, out) = (root().join("scenarios/close.toml"), folder.path().join("run"));
    let common = ["run", text(&scenario), "--out", text(&out), "--in-process", "--json"];
    let more = ["--duration", "100 ms", "--set", "record.controller=false"];
    let shadow = ["--shadow", "controller=builtin:controller"];
    let output = run_orchestrator(&[&common[..], &more, &shadow].concat());
    let found = &output.json()["shadows"][0];
    let refused = found["refused"].as_str().unwrap_or_default();
    assert!(
        refused.contains("nothing was compared: the tape has no output"),
        "{found}"
    );
    assert!(found.get("comparison").is_none(), "{found}");
}

#[test]
fn shadow_failure_does_not_end_the_run() {
    for (shadow, words) in [("crash_at", "abort"), ("panics", "panicked"), ("nan", "finite")] {
        let folder = Folder::new(shadow);
        let output = run_with_shadow(&folder, shadow);
        assert_eq!(output.code, Some(0), "{output:?}");
        let found = &output.json();
        assert_eq!(found["ending"]["status"], "complete");
        let ending = &found["shadows"][0]["ending"];
        assert_eq!(ending["status"], "failed", "{found}");
        assert!(ending["reason"].as_str().unwrap().contains(words), "{ending}");
        // Its earlier outputs are compared all the same.
        assert!(
            found["shadows"][0]["comparison"]["samples"].as_u64().unwrap() > 0,
            "{found}"
        );
    }
}

#[test]
fn other_ports_are_refused_with_the_difference() {
    let folder = Folder::new("ports");
    let out = folder.path().join("run");
    let scenario = root().join("scenarios/close.toml");
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&out),
        "--shadow",
        "guidance=builtin:controller",
    ]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(!out.exists(), "refused before anything runs");
    for (shadow, parts) in [
        ("controller=builtin:plant", &["participants.controller"][..]),
        (
            "controller=./nothing",
            &["participants.controller.run", "not an executable file"],
        ),
        ("pilot=builtin:controller", &["`pilot`"]),
        ("controller", &["PARTICIPANT=PROGRAM"]),
    ] {
        let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--shadow", shadow]);
        assert_eq!(output.code, Some(2), "{shadow}: {output:?}");
        for part in parts {
            assert!(
                output.err.contains(part),
                "{shadow}: `{part}` is not in: {}",
                output.err
            );
        }
    }
    // A separate program is queried before anything runs as well.
    for (shadow, code, parts) in [
        (
            "wrong_descriptor",
            2,
            ["participants.damper.run", "cannot be its shadow", "kN"],
        ),
        // Its death is no mistake in the request.
        ("early_exit", 1, ["`damper`", "exited with status 7", "licence server"]),
    ] {
        let output = run_with_shadow(&folder, shadow);
        assert_eq!(output.code, Some(code), "{output:?}");
        assert!(!out.exists(), "refused before anything runs");
        for part in parts {
            assert!(
                output.err.contains(part),
                "{shadow}: `{part}` is not in: {}",
                output.err
            );
        }
    }
}

#[test]
fn substitute_option_replaces_the_participant_from_the_start() {
    let folder = Folder::new("substitute");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let substitute = format!("damper={}", participant("nan").display());
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--substitute", &substitute]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`") && output.err.contains("finite"),
        "{output:?}"
    );
}

#[test]
fn two_shadows_of_one_participant_are_both_compared() {
    let folder = Folder::new("two-shadows");
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let shadow = format!("damper={}", participant("damper").display());
    let twice = ["--shadow", &shadow, "--shadow", &shadow];
    let output = run_orchestrator(&[&["run", text(&scenario), "--out", text(&out), "--json"], &twice[..]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    for (number, place) in ["damper", "damper-2"].into_iter().enumerate() {
        assert_eq!(
            output.json()["shadows"][number]["comparison"]["identical"],
            true,
            "{output:?}"
        );
        assert!(
            out.join("shadow").join(place).join("tape/index.json").exists(),
            "{place}"
        );
    }
}
