//! Times that a run does not have are rejected by the option that names them; events after its end are reported.

use escapement_tests::program::{Folder, root, run_orchestrator, text};

/// Every instant and every time span on the command line: negative, zero, after the end, and not a number.
#[test]
fn time_outside_the_run_is_refused_with_option_and_value() {
    let scenario = root().join("scenarios/close.toml");
    let folder = Folder::new("times");
    let out = folder.path().join("run");
    for (command, option, value, part) in [
        ("run", "--checkpoint-at", "-1s", "before the start"),
        ("run", "--checkpoint-at", "35s", "not before the end at 35 s"),
        ("run", "--checkpoint-at", "1e9h", "not before the end"),
        ("run", "--pause-at", "-1ns", "before the start"),
        ("run", "--pause-at", "36s", "not before the end"),
        ("run", "--checkpoint-every", "0s", "above zero"),
        ("run", "--checkpoint-every", "-2s", "above zero"),
        ("run", "--checkpoint-every", "35s", "no checkpoint"),
        ("run", "--checkpoint-every", "1us", "more than 10000"),
        ("run", "--patience", "0s", "above zero"),
        ("run", "--patience", "-1s", "above zero"),
        ("run", "--patience", "1e99s", "1e99s"),
        ("run", "--patience", "nan s", "not a time"),
        ("run", "--duration", "0s", "above zero"),
        ("run", "--duration", "-1s", "above zero"),
        ("run", "--duration", "1e99s", "1e99s"),
        ("run", "--real-time", "0", "not a pace"),
        ("run", "--real-time", "-1", "not a pace"),
        ("run", "--real-time", "nan", "not a pace"),
        ("run", "--real-time", "inf", "not a pace"),
        ("run", "--real-time", "1e-300", "not a pace"),
        ("faults", "--at", "-1s", "before the start"),
        ("faults", "--at", "35s", "not before the end"),
    ] {
        let given = format!("{option}={value}");
        let output = run_orchestrator(&[command, text(&scenario), &given, "--out", text(&out)]);
        assert_eq!(output.code, Some(2), "{given}: {output:?}");
        for part in [option, part] {
            assert!(output.err.contains(part), "{given}: `{part}` is not in {output:?}");
        }
    }
    assert!(!out.exists(), "nothing is written");
    for (option, value) in [
        ("--to", "0s"),
        ("--to", "-1s"),
        ("--wait-for-debugger", "-1s"),
        ("--patience", "0s"),
    ] {
        let given = format!("{option}={value}");
        let output = run_orchestrator(&["replay", text(&out), "--participant", "plant", &given]);
        assert_eq!(output.code, Some(2), "{given}: {output:?}");
        assert!(output.err.contains(option), "{given}: {output:?}");
    }
    let output = run_orchestrator(&["resume", text(&out), "--from=-1s"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("--from"), "{output:?}");
}

/// Events after the end of a shortened run are no mistake, but they are reported.
#[test]
fn fault_and_offset_after_the_end_are_warned_of() {
    let scenario = root().join("scenarios/close.toml");
    let check = |more: &[&str]| run_orchestrator(&[&["check", text(&scenario)], more].concat());
    let fault = "name=late,at=12s,input=controller.measured,field=q[3],kind=bias,value=0.2deg";
    let within = check(&["--fault", fault]);
    assert_eq!(
        (within.code, within.err.contains("warning")),
        (Some(0), false),
        "{within:?}"
    );
    let behind = check(&["--fault", fault, "--duration", "5s"]);
    assert_eq!(behind.code, Some(0), "{behind:?}");
    for part in ["warning", "faults.late.at", "12 s", "end at 5 s"] {
        assert!(behind.err.contains(part), "`{part}` is not in {behind:?}");
    }
    let failure = "participants.plant.parameters.faults=[{actuator=\"wheel.x\",effect=\"off\",from=\"35 s\"}]";
    let gripper = "participants.plant.parameters.after_grasp={at=\"40 s\"}";
    let of_plant = check(&["--set", failure, "--set", gripper]);
    assert_eq!(of_plant.code, Some(0), "{of_plant:?}");
    for part in [
        "faults[0].from: 35 s is not",
        "after_grasp.at: 40 s is not",
        "end at 35 s",
    ] {
        assert!(of_plant.err.contains(part), "`{part}` is not in {of_plant:?}");
    }
    let offset = check(&["--set", "participants.guidance.offset=35s"]);
    assert_eq!(offset.code, Some(0), "{offset:?}");
    for part in ["warning", "participants.guidance.offset", "35 s", "never activated"] {
        assert!(offset.err.contains(part), "`{part}` is not in {offset:?}");
    }
}
