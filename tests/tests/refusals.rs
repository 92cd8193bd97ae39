//! Whatever is wrong with a scenario is refused before anything starts: exit code 2, the file, the line, the key, the remedy, and
//! no run folder.

use std::path::Path;

use escapement_tests::program::{Folder, orchestrate, root};

fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are text")
}

/// Runs the close capture with `from` replaced by `to`; all of `expected` must be in the message.
fn refused(from: &str, to: &str, expected: &[&str]) {
    let folder = Folder::new("refused");
    let stock = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    assert!(stock.contains(from), "the stock scenario has no `{from}`");
    let changed = stock
        .replacen(from, to, 1)
        .replace("../", &format!("{}/", root().display()));
    let scenario = folder.write("changed.toml", &changed);
    let out = folder.path().join("run");
    for command in [
        &["run", text(&scenario), "--out", text(&out)][..],
        &["check", text(&scenario)],
    ] {
        let said = orchestrate(command);
        assert_eq!(said.code, Some(2), "{said:?}");
        for part in expected {
            assert!(said.err.contains(part), "`{part}` is not in: {}", said.err);
        }
        assert!(said.err.contains("changed.toml"), "{said:?}");
    }
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn an_unknown_key() {
    refused(
        "duration = ",
        "duratoin = \"1 s\"\nduration = ",
        &["changed.toml:", "duratoin", "unknown field"],
    );
}

#[test]
fn an_unknown_key_of_a_participant() {
    refused(
        "[participants.plant]",
        "[participants.plant]\nperoid = \"1 ms\"",
        &["participants.plant.peroid", "unknown field"],
    );
}

#[test]
fn an_unknown_parameter() {
    refused(
        "[participants.controller.parameters]",
        "[participants.controller.parameters]\nspeeed = 3",
        &["participants.controller.parameters", "speeed"],
    );
}

#[test]
fn a_wrong_unit() {
    refused(
        "period = \"1 ms\"",
        "period = \"1 m\"",
        &["participants.plant.period", "`1 m`", "not one of time"],
    );
}

#[test]
fn a_missing_connection() {
    refused(
        "to = \"plant.command\"",
        "to = []",
        &["connections.command.to", "names no input"],
    );
}

#[test]
fn a_file_that_is_not_there() {
    refused(
        "servicer.urdf",
        "serviser.urdf",
        &["participants.plant.parameters", "serviser.urdf", "cannot be read"],
    );
}

#[test]
fn a_builtin_that_is_not_there() {
    refused(
        "builtin = \"plant\"",
        "builtin = \"plan\"",
        &["participants.plant.run", "no builtin `plan`", "`plant`"],
    );
}

#[test]
fn text_that_is_not_toml() {
    refused(
        "[connections.command]",
        "[connections.command",
        &["changed.toml:", "is not TOML"],
    );
}

fn refused_with(set: &str, expected: &[&str]) {
    let scenario = root().join("scenarios/close.toml");
    let said = orchestrate(&["check", text(&scenario), "--set", set]);
    assert_eq!(said.code, Some(2), "{said:?}");
    for part in expected {
        assert!(said.err.contains(part), "`{part}` is not in: {}", said.err);
    }
}

#[test]
fn overrides_are_checked_like_the_file() {
    refused_with(
        "connections.measured.delay=-1ms",
        &["connections.measured", "-1 ms", "must not be negative"],
    );
    refused_with(
        "connections.nothing.delay=1ms",
        &["no `nothing`", "`measured`", "--set"],
    );
    refused_with(
        "connections.measured.drop=1.5",
        &["connections.measured", "1.5", "between 0 and 1"],
    );
    refused_with(
        "connections.command.initial=first-sample",
        &["connections.command", "first-sample", "initial value"],
    );
    refused_with(
        "connections.command.from=controller.comand",
        &["no output of `controller`", "`comand`", "`command`"],
    );
    refused_with(
        "connections.command.to=guidance.target",
        &["does not fit", "`plant.command` is not connected"],
    );
    refused_with(
        "connections.target.to=[\"guidance.target\", \"guidance.target\"]",
        &["`guidance.target` is fed twice"],
    );
    refused_with(
        "connections.setpoint.to=plant.command",
        &["does not fit", "f64 in s", "in N m, frame B"],
    );
    refused_with(
        "participants.plant.period=0s",
        &["participants.plant.period", "must be positive"],
    );
    refused_with("duration=0s", &["duration", "must be positive"]);
    refused_with("seed=-1", &["seed"]);
    refused_with(
        "participants.plant.run.exe=/bin/true",
        &["participants.plant.run", "either"],
    );
    refused_with("nonsense", &["KEY.PATH=VALUE"]);
}

#[test]
fn an_algebraic_loop_names_its_members_and_what_would_break_it() {
    let folder = Folder::new("loop");
    let scenario = folder.write(
        "loop.toml",
        r#"duration = "1 s"
[participants.a]
run = { builtin = "bench-sampled" }
period = "1 ms"
[participants.b]
run = { builtin = "bench-sampled" }
period = "3 ms"
[connections.there]
from = "a.to"
to = "b.from"
[connections.back]
from = "b.to"
to = "a.from"
"#,
    );
    let said = orchestrate(&["check", text(&scenario)]);
    assert_eq!(said.code, Some(2), "{said:?}");
    for part in ["algebraic loop at t = 0 s", "a -> b -> a", "`there`", "`back`", "delay"] {
        assert!(said.err.contains(part), "`{part}` is not in: {}", said.err);
    }
    // Members that never meet at an instant form no loop; neither does a circle with a delay in it.
    for cure in ["participants.b.offset=0.5ms", "connections.back.delay=1us"] {
        let said = orchestrate(&["check", text(&scenario), "--set", cure]);
        assert_eq!(said.code, Some(0), "{cure}: {said:?}");
    }
}

#[test]
fn a_run_folder_is_never_overwritten() {
    let folder = Folder::new("taken");
    folder.write("precious.txt", "work of years");
    let scenario = root().join("scenarios/close.toml");
    let said = orchestrate(&[
        "run",
        text(&scenario),
        "--out",
        text(folder.path()),
        "--duration",
        "10 ms",
    ]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("not empty") && said.err.contains("--out"), "{said:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
