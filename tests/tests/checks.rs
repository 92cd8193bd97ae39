//! `check` and `graph` predict the result of a run, or report that they cannot.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use escapement_tests::fixture::{RunFixture, substitution, write_oscillator};
use escapement_tests::machine::leftovers;
use escapement_tests::program::{Folder, orchestrator, participant, run_orchestrator, text};

/// Two sampled programs in a ring: `z` must be executed first, `a` is first by name.
fn write_algebraic_loop(folder: &Folder, delay: &str) -> PathBuf {
    let run = format!(
        "run = {{ exe = \"{}\", args = [\"participant\", \"bench-sampled\"] }}\nperiod = \"10 ms\"\n",
        orchestrator().display()
    );
    folder.write(
        "ring.toml",
        &format!(
            "duration = \"100 ms\"\n[participants.a]\n{run}[participants.z]\n{run}[connections.there]\nfrom = \"z.to\"\n\
             to = \"a.from\"\n[connections.back]\nfrom = \"a.to\"\nto = \"z.from\"\ndelay = \"{delay}\"\n"
        ),
    )
}

fn position(text: &str, part: &str) -> usize {
    text.find(part).unwrap_or_else(|| panic!("`{part}` is not in {text}"))
}

#[test]
fn algebraic_loop_of_programs_is_refused_by_check_graph_and_run() {
    let folder = Folder::new("ring");
    let scenario = write_algebraic_loop(&folder, "0 s");
    let out = folder.path().join("run");
    for command in [
        &["check", text(&scenario)][..],
        &["check", text(&scenario), "--start"],
        &["graph", text(&scenario)],
        &["run", text(&scenario), "--out", text(&out)],
    ] {
        let output = run_orchestrator(command);
        assert_eq!(output.code, Some(2), "{command:?}: {output:?}");
        assert!(
            output.err.contains("algebraic loop") && output.err.contains("`there`"),
            "{output:?}"
        );
    }
    assert!(!out.exists(), "a refused run leaves nothing");
    assert_eq!(leftovers(), Vec::<String>::new());
}

#[test]
fn programs_not_queried_have_no_kind_and_no_order() {
    let folder = Folder::new("unasked");
    let scenario = write_algebraic_loop(&folder, "0 s");
    let output = run_orchestrator(&["check", text(&scenario), "--start=never"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.out.contains("not asked: a, z") && output.out.contains("--start"),
        "{output:?}"
    );
    assert!(
        !output.out.contains("Continuous") && !output.out.contains("in the order"),
        "{output:?}"
    );
    let output = run_orchestrator(&["check", text(&scenario), "--start=never", "--json"]).json();
    assert_eq!(output["unknown"], serde_json::json!(["a", "z"]));
    for participant in output["plan"]["participants"].as_array().unwrap() {
        assert!(
            participant["rank"].is_null() && participant["interface"].is_null(),
            "{participant}"
        );
    }
    for format in ["mermaid", "dot"] {
        let output = run_orchestrator(&["graph", text(&scenario), "--start=never", "--format", format]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert!(
            output.out.contains("kind unknown") && !output.out.contains("order"),
            "{output:?}"
        );
    }
}

#[test]
fn queried_programs_are_listed_in_execution_order() {
    let folder = Folder::new("asked");
    let scenario = write_algebraic_loop(&folder, "10 ms");
    let output = run_orchestrator(&["check", text(&scenario)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(output.out.contains("in the order of activations"), "{output:?}");
    assert!(
        position(&output.out, "  z  ") < position(&output.out, "  a  "),
        "{output:?}"
    );
    assert!(position(&output.out, "Sampled every 10 ms") > 0, "{output:?}");
    let output = run_orchestrator(&["graph", text(&scenario)]);
    assert!(
        output.out.contains("a<br/>every 10 ms, order 2") && output.out.contains("z<br/>every 10 ms, order 1"),
        "{output:?}"
    );
    // A program whose ports do not fit, and one whose parameters are rejected, are reported without a run too.
    let folder = Folder::new("misfit");
    let output = run_orchestrator(&["check", text(&write_oscillator(&folder, "wrong_descriptor"))]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("does not fit") && output.err.contains("kN"),
        "{output:?}"
    );
}

#[test]
fn program_crash_during_query_is_failure_not_scenario_error() {
    // The program of a participant, of a substitute at a given time, and of a substitute after a failure.
    let died = ["exited with status 7", "the licence server does not answer"];
    let fixture = RunFixture::new("asked", "early_exit");
    let later = RunFixture::with_appended("later", "damper", &substitution("2 s", "early_exit", "cold"));
    let policy = format!(
        "participants.damper.on-failure={{ substitute = {{ exe = \"{}\" }} }}",
        participant("early_exit").display()
    );
    let healthy = RunFixture::new("healthy", "damper");
    let shadow = format!("damper={}", participant("early_exit").display());
    let check =
        |fixture: &RunFixture, more: &[&str]| run_orchestrator(&[&["check", text(&fixture.scenario)], more].concat());
    for output in [
        fixture.run("run", &[]),
        check(&fixture, &[]),
        later.run("run", &[]),
        check(&later, &[]),
        healthy.run("policy", &["--set", &policy]),
        check(&healthy, &["--set", &policy]),
        healthy.run("shadow", &["--shadow", &shadow]),
    ] {
        assert_eq!(output.code, Some(1), "{output:?}");
        for part in ["damper", died[0], died[1]] {
            assert!(output.err.contains(part), "`{part}` is not in {output:?}");
        }
    }
}

#[test]
fn non_executable_file_is_refused_with_its_key() {
    let folder = Folder::new("no-program");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        path
    };
    let scenario = write_oscillator(&folder, "damper");
    let assert_refused = |program: &Path, key: &str, set: &str| {
        let out = folder.path().join("run");
        let output = run_orchestrator(&["run", text(&scenario), "--set", set, "--out", text(&out)]);
        assert_eq!(output.code, Some(2), "{}: {output:?}", program.display());
        assert!(output.err.contains(key), "{output:?}");
        assert!(!out.exists(), "a refused run leaves nothing: {output:?}");
    };
    for program in [write("lost", b"#!/nowhere/at/all\n"), folder.path().join("missing")] {
        let exe = format!("{{ exe = \"{}\" }}", program.display());
        let key = "participants.damper.run";
        assert_refused(&program, key, &format!("{key}={exe}"));
        let key = "participants.damper.on-failure";
        assert_refused(&program, key, &format!("{key}={{ substitute = {exe} }}"));
    }
}

#[test]
fn reserved_name_is_refused() {
    let folder = Folder::new("reserved");
    let text_of = std::fs::read_to_string(write_oscillator(&folder, "damper")).unwrap();
    let scenario = folder.write(
        "reserved.toml",
        &text_of
            .replace("damper]", "orchestrator]")
            .replace("\"damper.", "\"orchestrator."),
    );
    for command in ["check", "run"] {
        let output = run_orchestrator(&[command, text(&scenario)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output.err.contains("participants.orchestrator") && output.err.contains("another one"),
            "{output:?}"
        );
    }
}
