//! The program that a substitution starts: the same program with the same parameters however a run is executed, from any checkpoint
//! where it is resumed, and when it is replayed.

use std::path::{Path, PathBuf};

use escapement_tests::fixture::{RunFixture, substitution};
use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use testing::random::SplitMix;

/// The close capture, with a setpoint that moves from the start on, and `faults`.
fn scenario(folder: &Folder, name: &str, faults: &str) -> PathBuf {
    let stock = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    let quick = stock
        .replace("start = \"1 s\", point = \"20 s\", grasp = \"30 s\"", SCHEDULE)
        .replace("duration = \"35 s\"", "duration = \"0.4 s\"")
        .replace("../", &format!("{}/", root().display()));
    assert!(quick.contains(SCHEDULE) && quick.contains("0.4 s"));
    folder.write(name, &(quick + faults))
}

/// The schedule of the guidance in the scenario.
const SCHEDULE: &str = "start = \"0 s\", point = \"2 s\", grasp = \"3 s\"";

/// `parameters` of a guidance with this schedule.
fn guidance(schedule: &str) -> String {
    let root = root();
    let file = |name: &str| format!("{{ file = \"{}/models/{name}\" }}", root.display());
    format!(
        "parameters = {{ urdf = {}, servicer = {}, target = {}, law = \"capture\", schedule = {{ {schedule} }} }}\n",
        file("servicer.urdf"),
        file("servicer.toml"),
        file("target.toml"),
    )
}

/// `parameters` of a controller with this gain of the outer loop.
fn controller(gain: &str) -> String {
    let root = root();
    let file = |name: &str| format!("{{ file = \"{}/{name}\" }}", root.display());
    format!(
        "parameters = {{ urdf = {}, servicer = {}, gains = {}, law = \"hierarchical\", outer = {{ attitude_gain = \"{gain} 1/s\", \
         position_gain = \"{gain} 1/s\" }} }}\n",
        file("models/servicer.urdf"),
        file("models/servicer.toml"),
        file("gains/pi-diagonal-five.toml"),
    )
}

fn fault(at: &str, participant: &str, state: &str, parameters: &str) -> String {
    format!(
        "\n[[faults]]\nat = \"{at}\"\nsubstitute = \"{participant}\"\nrun = {{ builtin = \"{participant}\" }}\nstate = \"{state}\"\n\
         {parameters}"
    )
}

fn digest(output: &ProgramOutput) -> String {
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    output.json()["tape_digest"].as_str().unwrap().to_owned()
}

fn run(scenario: &Path, out: &Path, more: &[&str]) -> String {
    digest(&run_orchestrator(
        &[&["run", text(scenario), "--json", "--out", text(out)], more].concat(),
    ))
}

/// The common tape of a run in processes, of one in one process, and of the runs resumed from each of `cuts` in both ways.
fn assert_one_tape(folder: &Folder, scenario: &Path, name: &str, cuts: &[&str]) -> String {
    let out = |way: &str| folder.path().join(format!("{name}-{way}"));
    let saves: Vec<&str> = cuts.iter().flat_map(|cut| ["--checkpoint-at", cut]).collect();
    let whole = run(scenario, &out("processes"), &saves);
    let inside = [&["--in-process"], &saves[..]].concat();
    assert_eq!(run(scenario, &out("inside"), &inside), whole, "{name} in one process");
    for (number, cut) in cuts.iter().enumerate() {
        // A run saved in processes is resumed in one process, and the other way round.
        for (from, to, more) in [
            ("processes", "inside", &["--in-process"][..]),
            ("inside", "processes", &[]),
        ] {
            let (saved, resumed) = (out(from), out(&format!("resumed-{number}-{to}")));
            let arguments = ["resume", text(&saved), "--from", cut, "--json", "--out", text(&resumed)];
            let output = run_orchestrator(&[&arguments, more].concat());
            assert_eq!(digest(&output), whole, "{name} resumed at {cut} {more:?}");
        }
    }
    whole
}

#[test]
fn substitute_without_parameters_has_those_of_participant() {
    let folder = Folder::new("parameters");
    let (other, own) = (
        guidance("start = \"0 s\", point = \"1 s\", grasp = \"4 s\""),
        guidance(SCHEDULE),
    );
    let twice =
        |second: &str| fault("100 ms", "guidance", "cold", &other) + &fault("200 ms", "guidance", "cold", second);
    let file = scenario(&folder, "twice.toml", &twice(""));
    let tape = assert_one_tape(&folder, &file, "twice", &["50 ms", "150 ms", "250 ms"]);
    // The second substitution states no parameters: it has those of the participant, not those of the previous one.
    let explicit = scenario(&folder, "explicit.toml", &twice(&own));
    assert_eq!(run(&explicit, &folder.path().join("explicit"), &["--in-process"]), tape);
    let inherited = scenario(&folder, "inherited.toml", &twice(&other));
    assert_ne!(
        run(&inherited, &folder.path().join("inherited"), &["--in-process"]),
        tape
    );
    // `check` reports whose parameters they are.
    let output = run_orchestrator(&["check", text(&file)]);
    assert!(
        output.out.contains("its own parameters") && output.out.contains("the same parameters"),
        "{output:?}"
    );
}

#[test]
fn any_substitutions_give_one_tape_in_every_way() {
    let folder = Folder::new("any");
    let mut random = SplitMix(20_261_126);
    let mut draw = |below: u64| random.bits() % below;
    let mut tapes = std::collections::HashSet::new();
    for round in 0..4 {
        let mut faults = String::new();
        for _ in 0..2 + draw(3) {
            // Not always at an activation, and sometimes several at once.
            let at = format!("{} ms", [15, 100, 100, 155, 200, 290][draw(6) as usize]);
            let state = ["cold", "keep"][draw(2) as usize];
            let (own, tenth) = (draw(2) == 0, 5 + draw(20));
            faults += &match (draw(2), own) {
                (0, true) => {
                    let schedule = format!("start = \"0 s\", point = \"{} s\", grasp = \"4 s\"", 1 + tenth % 3);
                    fault(&at, "guidance", state, &guidance(&schedule))
                }
                (0, false) => fault(&at, "guidance", state, ""),
                (_, true) => fault(&at, "controller", state, &controller(&format!("0.{tenth:02}"))),
                (_, false) => fault(&at, "controller", state, ""),
            };
        }
        let name = format!("round-{round}");
        let file = scenario(&folder, &format!("{name}.toml"), &faults);
        tapes.insert(assert_one_tape(&folder, &file, &name, &["100 ms", "222 ms"]));
    }
    assert_eq!(tapes.len(), 4, "what is substituted shows on the tape");
}

#[test]
fn replay_substitutes_as_the_run_did() {
    let folder = Folder::new("replayed");
    let other = guidance("start = \"0 s\", point = \"1 s\", grasp = \"4 s\"");
    let faults = fault("100 ms", "guidance", "cold", &other) + &fault("200 ms", "guidance", "keep", "");
    let file = scenario(&folder, "replayed.toml", &faults);
    let out = folder.path().join("run");
    run(&file, &out, &[]);
    for mode in [&[][..], &["--process"]] {
        let output = run_orchestrator(&[&["replay", text(&out), "--participant", "guidance"], mode].concat());
        assert_eq!(output.code, Some(0), "{mode:?}: {output:?}");
    }
    // Another program in its place from the start to the end.
    let output = run_orchestrator(&[
        "replay",
        text(&out),
        "--participant",
        "guidance",
        "--set",
        "participants.guidance.run={ builtin = \"guidance\" }",
    ]);
    assert_eq!(output.code, Some(3), "{output:?}");
}

#[test]
fn refused_parameters_of_a_substitute_name_their_own_key() {
    let folder = Folder::new("keys");
    let wrong = guidance("start = \"0 s\", point = \"1 s\", grap = \"4 s\"");
    let file = scenario(&folder, "keys.toml", &fault("100 ms", "guidance", "cold", &wrong));
    for command in ["check", "run"] {
        let output = run_orchestrator(&[command, text(&file)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains("faults.fault-1.parameters.schedule"), "{output:?}");
    }
}

#[test]
fn forty_substitutions_take_place() {
    let many: String = (1..=40)
        .map(|k| substitution(&format!("{k}0 ms"), "damper", "keep"))
        .collect();
    let fixture = RunFixture::with_appended("forty", "damper", &many);
    let output = fixture.run("run", &["--duration", "1 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(fixture.events("run").matches("\"substitution\"").count(), 40);
    assert_eq!(fixture.assert_prefix("run"), 100);
    // More substitutions than the limit are rejected before anything starts.
    let more: String = (1..=1001)
        .map(|k| substitution(&format!("{k} ms"), "damper", "cold"))
        .collect();
    let fixture = RunFixture::with_appended("too-many", "damper", &more);
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("faults.fault-1001") && output.err.contains("1000"),
        "{output:?}"
    );
}

/// The output of `check` for `file` with these options.
fn check(file: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["check", text(file)], more].concat())
}

#[test]
fn set_applies_after_substitute() {
    let folder = Folder::new("in-order");
    let file = scenario(&folder, "in-order.toml", "");
    let wrong = ["--substitute", "controller=builtin:pilot"];
    let output = check(&file, &wrong);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        "participants.controller.run",
        "no builtin `pilot`",
        "given with --substitute",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    for (set, code, part) in [
        ("participants.controller.run={ builtin = \"controller\" }", 0, ""),
        ("participants.controller.run.args=[\"x\"]", 2, "takes no args"),
        ("participants.controller.period=20ms", 2, "no builtin `pilot`"),
    ] {
        let own = if code == 2 && part.ends_with("args") {
            "controller=builtin:controller"
        } else {
            wrong[1]
        };
        let output = check(&file, &["--set", set, "--substitute", own]);
        assert_eq!(output.code, Some(code), "{set}: {output:?}");
        assert!(output.err.contains(part), "{set}: `{part}` is not in {output:?}");
    }
}

#[test]
fn options_complete_an_incomplete_file() {
    let folder = Folder::new("left-out");
    let whole = std::fs::read_to_string(scenario(&folder, "whole.toml", "")).unwrap();
    let bare = whole
        .replace("duration = \"0.4 s\"\n", "")
        .replace("run = { builtin = \"controller\" }\n", "");
    let file = folder.write("bare.toml", &bare);
    let output = check(&file, &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        "missing field `duration`",
        "participants.controller.run: write { builtin",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    let given = ["--duration", "0.4 s", "--substitute", "controller=builtin:controller"];
    assert_eq!(check(&file, &given).code, Some(0));
    let output = check(
        &file,
        &["--duration", "0.4 s", "--substitute", "nobody=builtin:controller"],
    );
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in ["no `nobody`", "given with --substitute", "`guidance`"] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
}
