//! Well-formed but invalid samples, and the guards that reject them.

use escapement_tests::fixture::RunFixture;
use escapement_tests::program::{Folder, participant, root, run_orchestrator, text};

const GUARDS: &str = r#"
[guards.strong]
output = "damper.push"
field = "force"
range = "[-80, 80] N"

[guards.alive]
output = "damper.push"
frozen-for = "500 ms"
"#;

#[test]
fn outputs_within_their_guards_pass() {
    let fixture = RunFixture::with_appended("truth", "damper", GUARDS);
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
}

#[test]
fn out_of_range_value_ends_run_with_field_time_and_value() {
    let fixture = RunFixture::with_appended("range", "out_of_range", GUARDS);
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    let words = "participant `damper`: gave out `damper.push` sample #200 at t = 2 s with force = 90 N, outside of -80 to 80 N \
                 (guard `strong`)";
    assert!(output.err.contains(words), "{output:?}");
    // The sample is on the tape, because other participants may have seen it.
    let tape = std::fs::read(fixture.path("run/tape/damper.push.bin")).unwrap();
    assert!(tape.len() >= 24 * 201, "{}", tape.len());
    assert_eq!(tape[24 * 200 + 8..24 * 200 + 16], 90_f64.to_le_bytes());
}

#[test]
fn frozen_output_ends_the_run() {
    let fixture = RunFixture::with_appended("frozen", "frozen", GUARDS);
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "participant `damper`",
        "sample #250 at t = 2.5 s frozen: force = ",
        "since t = 2 s (guard `alive`)",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
}

#[test]
fn offending_participant_can_be_replaced_but_not_restarted() {
    let good = participant("damper").display().to_string();
    for (offender, first) in [("out_of_range", 200), ("frozen", 250)] {
        let fixture = RunFixture::with_appended("replaced", offender, GUARDS);
        let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {good:?} }} }}");
        let output = fixture.run("run", &["--set", &policy, "--checkpoint-every", "3s"]);
        assert_eq!(output.code, Some(0), "{output:?}");
        // How far the offending participant has got by then depends on the machine, but it is not past the next pause.
        let count = fixture.count("run", 999);
        assert!((700..1000 - first).contains(&count), "{count}");
        let output = fixture.run(
            "again",
            &["--set", "participants.damper.on-failure=restart-from-checkpoint"],
        );
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(
            output.err.contains("a restart would have to give the same again"),
            "{output:?}"
        );
    }
}

#[test]
fn finished_offending_participant_cannot_be_replaced() {
    let good = participant("damper").display().to_string();
    let fixture = RunFixture::with_appended("finished", "out_of_range", GUARDS);
    let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {good:?} }} }}");
    // Its last sample is the first invalid one.
    let output = fixture.run("run", &["--set", &policy, "--duration", "2.01s"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "sample #200",
        "(guard `strong`)",
        "it had taken its last step",
        "--checkpoint-every",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
}

#[test]
fn guard_violation_ends_run_in_one_process() {
    let folder = Folder::new("guards");
    let guard = "guards.weak={ output = \"controller.command\", field = \"tau[2]\", range = \"[-1, 1] mN m\" }";
    let scenario = root().join("scenarios/close.toml");
    let mut messages = Vec::new();
    for (name, more) in [("one", &["--in-process"][..]), ("many", &[])] {
        let out = folder.path().join(name);
        let arguments = ["run", text(&scenario), "--out", text(&out), "--quiet", "--set", guard];
        let it = run_orchestrator(&[&arguments[..], more].concat());
        assert_eq!(it.code, Some(1), "{it:?}");
        assert!(
            it.err
                .contains("participant `controller`: gave out `controller.command`"),
            "{it:?}"
        );
        messages.push(it.err);
    }
    assert_eq!(messages[0], messages[1]);
}

/// The modes that the stock participants report have names, which guards and messages use.
#[test]
fn stock_modes_are_guarded_by_name() {
    let folder = Folder::new("modes");
    let scenario = root().join("scenarios/close.toml");
    for (output, field, never, words) in [
        (
            "guidance.telemetry",
            "phase",
            "\"Pointing\"",
            "phase = Pointing, which must never be",
        ),
        (
            "controller.telemetry",
            "mode",
            "\"Tracking\"",
            "mode = Tracking, which must never be",
        ),
        ("plant.truth", "grasped", "false", "grasped = 0, which must never be"),
    ] {
        let guard = format!("guards.named={{ output = \"{output}\", field = \"{field}\", never = {never} }}");
        let out = folder.path().join(field);
        let output = run_orchestrator(&[
            "run",
            text(&scenario),
            "--out",
            text(&out),
            "--in-process",
            "--set",
            &guard,
        ]);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(output.err.contains(words), "`{words}` is not in {output:?}");
    }
}

#[test]
fn invalid_guard_is_refused_with_the_remedy() {
    let folder = Folder::new("refused");
    let close = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    let close = close.replace("\"../", &format!("\"{}/", root().display()));
    for (guard, parts) in [
        (
            "output = \"controller\"\nfrozen-for = \"1 s\"",
            &["guards.g.output", "not a port"][..],
        ),
        (
            "output = \"pilot.command\"\nfrozen-for = \"1 s\"",
            &["guards.g.output", "`pilot`", "`controller`"],
        ),
        (
            "output = \"controller.thrust\"\nfrozen-for = \"1 s\"",
            &["guards.g.output", "`thrust`", "`command`"],
        ),
        (
            "output = \"controller.command\"",
            &["guards.g:", "against nothing", "frozen-for"],
        ),
        (
            "output = \"controller.command\"\nrange = \"[-1, 1] N m\"",
            &["guards.g:", "`field` is missing"],
        ),
        (
            "output = \"controller.command\"\nfield = \"warp\"\nrange = \"[-1, 1] N m\"",
            &["guards.g.field", "`warp`", "tau"],
        ),
        (
            "output = \"controller.command\"\nfield = \"tau\"\nrange = \"[-1, 1] deg\"",
            &["guards.g.range", "N m"],
        ),
        (
            "output = \"controller.command\"\nfield = \"tau\"\nrange = \"[1, -1] N m\"",
            &["guards.g.range", "is not a range", "lower one first"],
        ),
        (
            "output = \"controller.command\"\nfield = \"tau\"\nrange = \"3 N m\"",
            &["guards.g.range", "is not a range"],
        ),
        (
            "output = \"controller.command\"\nfrozen-for = \"0 s\"",
            &["guards.g.frozen-for", "above zero"],
        ),
        ("output = \"controller.command\"\nforever = true", &["guards.g.forever"]),
    ] {
        let file = folder.write("bad.toml", &format!("{close}\n[guards.g]\n{guard}\n"));
        let output = run_orchestrator(&["check", text(&file)]);
        assert_eq!(output.code, Some(2), "{guard}: {output:?}");
        for part in [&["bad.toml:"], parts].concat() {
            assert!(output.err.contains(part), "{guard}: `{part}` is not in {}", output.err);
        }
    }
}
