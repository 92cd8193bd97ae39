//! `check` and `graph` predict the result of a run, or report that they cannot.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use escapement_tests::machine::leftovers;
use escapement_tests::program::{Folder, orchestrate, orchestrator, participant, text};
use escapement_tests::world::{World, oscillator, substitution};

/// Two sampled programs in a ring: `z` must be executed first, `a` is first by name.
fn ring(folder: &Folder, delay: &str) -> PathBuf {
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
    let scenario = ring(&folder, "0 s");
    let out = folder.path().join("run");
    for command in [
        &["check", text(&scenario)][..],
        &["check", text(&scenario), "--start"],
        &["graph", text(&scenario)],
        &["run", text(&scenario), "--out", text(&out)],
    ] {
        let said = orchestrate(command);
        assert_eq!(said.code, Some(2), "{command:?}: {said:?}");
        assert!(
            said.err.contains("algebraic loop") && said.err.contains("`there`"),
            "{said:?}"
        );
    }
    assert!(!out.exists(), "a refused run leaves nothing");
    assert_eq!(leftovers(), Vec::<String>::new());
}

#[test]
fn programs_not_queried_have_no_kind_and_no_order() {
    let folder = Folder::new("unasked");
    let scenario = ring(&folder, "0 s");
    let said = orchestrate(&["check", text(&scenario), "--start=never"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(
        said.out.contains("not asked: a, z") && said.out.contains("--start"),
        "{said:?}"
    );
    assert!(
        !said.out.contains("Continuous") && !said.out.contains("in the order"),
        "{said:?}"
    );
    let said = orchestrate(&["check", text(&scenario), "--start=never", "--json"]).json();
    assert_eq!(said["unknown"], serde_json::json!(["a", "z"]));
    for participant in said["plan"]["participants"].as_array().unwrap() {
        assert!(
            participant["rank"].is_null() && participant["interface"].is_null(),
            "{participant}"
        );
    }
    for format in ["mermaid", "dot"] {
        let said = orchestrate(&["graph", text(&scenario), "--start=never", "--format", format]);
        assert_eq!(said.code, Some(0), "{said:?}");
        assert!(
            said.out.contains("kind unknown") && !said.out.contains("order"),
            "{said:?}"
        );
    }
}

#[test]
fn queried_programs_are_listed_in_execution_order() {
    let folder = Folder::new("asked");
    let scenario = ring(&folder, "10 ms");
    let said = orchestrate(&["check", text(&scenario)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("in the order of activations"), "{said:?}");
    assert!(position(&said.out, "  z  ") < position(&said.out, "  a  "), "{said:?}");
    assert!(position(&said.out, "Sampled every 10 ms") > 0, "{said:?}");
    let said = orchestrate(&["graph", text(&scenario)]);
    assert!(
        said.out.contains("a<br/>every 10 ms, order 2") && said.out.contains("z<br/>every 10 ms, order 1"),
        "{said:?}"
    );
    // A program whose ports do not fit, and one whose parameters are rejected, are reported without a run too.
    let folder = Folder::new("misfit");
    let said = orchestrate(&["check", text(&oscillator(&folder, "wrong_descriptor"))]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("does not fit") && said.err.contains("kN"), "{said:?}");
}

#[test]
fn program_crash_during_query_is_failure_not_scenario_error() {
    // The program of a participant, of a substitute at a given time, and of a substitute after a failure.
    let died = ["exited with status 7", "the licence server does not answer"];
    let world = World::new("asked", "early_exit");
    let later = World::with("later", "damper", &substitution("2 s", "early_exit", "cold"));
    let policy = format!(
        "participants.damper.on-failure={{ substitute = {{ exe = \"{}\" }} }}",
        participant("early_exit").display()
    );
    let healthy = World::new("healthy", "damper");
    let shadow = format!("damper={}", participant("early_exit").display());
    let check = |world: &World, more: &[&str]| orchestrate(&[&["check", text(&world.scenario)], more].concat());
    for said in [
        world.run("run", &[]),
        check(&world, &[]),
        later.run("run", &[]),
        check(&later, &[]),
        healthy.run("policy", &["--set", &policy]),
        check(&healthy, &["--set", &policy]),
        healthy.run("shadow", &["--shadow", &shadow]),
    ] {
        assert_eq!(said.code, Some(1), "{said:?}");
        for part in ["damper", died[0], died[1]] {
            assert!(said.err.contains(part), "`{part}` is not in {said:?}");
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
    let scenario = oscillator(&folder, "damper");
    let refused = |program: &Path, key: &str, set: &str| {
        let out = folder.path().join("run");
        let said = orchestrate(&["run", text(&scenario), "--set", set, "--out", text(&out)]);
        assert_eq!(said.code, Some(2), "{}: {said:?}", program.display());
        assert!(said.err.contains(key), "{said:?}");
        assert!(!out.exists(), "a refused run leaves nothing: {said:?}");
    };
    for program in [write("lost", b"#!/nowhere/at/all\n"), folder.path().join("missing")] {
        let exe = format!("{{ exe = \"{}\" }}", program.display());
        let key = "participants.damper.run";
        refused(&program, key, &format!("{key}={exe}"));
        let key = "participants.damper.on-failure";
        refused(&program, key, &format!("{key}={{ substitute = {exe} }}"));
    }
}

#[test]
fn reserved_name_is_refused() {
    let folder = Folder::new("reserved");
    let text_of = std::fs::read_to_string(oscillator(&folder, "damper")).unwrap();
    let scenario = folder.write(
        "reserved.toml",
        &text_of
            .replace("damper]", "orchestrator]")
            .replace("\"damper.", "\"orchestrator."),
    );
    for command in ["check", "run"] {
        let said = orchestrate(&[command, text(&scenario)]);
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(
            said.err.contains("participants.orchestrator") && said.err.contains("another one"),
            "{said:?}"
        );
    }
}
