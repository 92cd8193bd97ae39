//! Participants that die while all participants are being moved: each such death is one more failure, and follows the policy.

use escapement_tests::fixture::{RunFixture, substitution};
use escapement_tests::program::participant;

/// `--set` of the program in `slot`: `dies` with the folder of its marker files and its `moments`.
fn run_dying(fixture: &RunFixture, slot: &str, moments: &[&str]) -> String {
    let folder = fixture.folder.path().display().to_string();
    let arguments: Vec<&str> = [&[folder.as_str()], moments].concat();
    let exe = participant("dies").display().to_string();
    format!("participants.{slot}.run={{ exe = {exe:?}, args = {arguments:?} }}")
}

fn policy(slot: &str, policy: &str) -> String {
    format!("participants.{slot}.on-failure={policy}")
}

const BACK: &str = "restart-from-checkpoint";

#[test]
fn participant_that_dies_during_relocation_is_restarted() {
    // The plant dies in its step, and one of the two once more when the run is restored.
    for (plant, damper) in [
        (&["late"][..], &["restore"][..]),
        (&["late", "restore"], &[]),
        (&["late"], &["restore", "late"]),
        (&["late", "restore"], &["restore", "late", "save"]),
    ] {
        let fixture = RunFixture::new("back", "damper");
        let (plant_runs, damper_runs) = (
            run_dying(&fixture, "plant", plant),
            run_dying(&fixture, "damper", damper),
        );
        let (plant_policy, damper_policy) = (policy("plant", BACK), policy("damper", BACK));
        let mut more = vec!["--checkpoint-every", "2 s"];
        for set in [&plant_runs, &damper_runs, &plant_policy, &damper_policy] {
            more.extend(["--set", set]);
        }
        let output = fixture.run("run", &more);
        assert_eq!(output.code, Some(0), "{plant:?} {damper:?}: {output:?}");
        fixture.assert_same_as_undisturbed("run");
        for (slot, moment) in plant
            .iter()
            .map(|it| ("plant", it))
            .chain(damper.iter().map(|it| ("damper", it)))
        {
            assert!(
                fixture.path(&format!("{slot} {moment}")).exists(),
                "{slot} did not die at {moment}"
            );
        }
        assert!(fixture.events("run").contains("\"restart\""));
    }
}

#[test]
fn participant_that_fails_in_relocation_is_not_replaced() {
    // The substitute would start at the end of the tape, and the others are at the restored checkpoint.
    let fixture = RunFixture::new("rewound", "damper");
    let (plant, damper) = (
        run_dying(&fixture, "plant", &["late"]),
        run_dying(&fixture, "damper", &["restore"]),
    );
    let backup = format!("{{ substitute = {{ exe = '{}' }} }}", participant("damper").display());
    let (back, replaced) = (policy("plant", BACK), policy("damper", &backup));
    let mut more = vec!["--checkpoint-every", "2 s", "--patience", "5 s"];
    for set in [&plant, &damper, &back, &replaced] {
        more.extend(["--set", set]);
    }
    let output = fixture.run("run", &more);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    for mark in ["plant late", "damper restore"] {
        assert!(fixture.path(mark).exists(), "no death: {mark}");
    }
    assert!(!fixture.events("run").contains("\"substitution\""));
}

#[test]
fn participant_that_dies_in_save_is_relocated_with_the_others() {
    let fixture = RunFixture::new("state", "damper");
    let (runs, policy) = (run_dying(&fixture, "damper", &["save"]), policy("damper", BACK));
    let output = fixture.run("run", &["--set", &runs, "--set", &policy, "--checkpoint-every", "4 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(output.err.contains("when it was asked for its state"), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    // The checkpoint at which it died was completed in the end.
    assert_eq!(fixture.resume("run", "resumed", &["--from", "4 s"]).code, Some(0));
    fixture.assert_same_as_undisturbed("resumed");
}

#[test]
fn death_at_the_start_of_a_resumed_run_is_recovered() {
    let fixture = RunFixture::new("resumed", "damper");
    let output = fixture.run("run", &["--checkpoint-at", "4 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    // Its state is requested before it has stepped in the resumed run.
    let (runs, policy) = (run_dying(&fixture, "damper", &["first-save"]), policy("damper", BACK));
    let output = fixture.resume("run", "resumed", &["--set", &runs, "--set", &policy]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(fixture.path("damper first-save").exists(), "it did not die");
    fixture.assert_same_as_undisturbed("resumed");
}

#[test]
fn substitute_that_dies_at_takeover_follows_the_slots_policy() {
    let fixture = RunFixture::with_appended("newcomer", "damper", &substitution("4.5 s", "dies", "keep"));
    let scenario = std::fs::read_to_string(&fixture.scenario).unwrap();
    let marks = format!(
        "args = [\"{}\", \"take-over\", \"restore\", \"save\"] }}",
        fixture.folder.path().display()
    );
    let scenario = scenario.replace("/dies\" }", &format!("/dies\", {marks}"));
    std::fs::write(&fixture.scenario, scenario).unwrap();
    let output = fixture.run("run", &["--checkpoint-every", "2 s", "--set", &policy("damper", BACK)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    for moment in ["take-over", "restore", "save"] {
        assert!(
            fixture.path(&format!("damper {moment}")).exists(),
            "it did not die at {moment}"
        );
    }
    let output = fixture.run("stopped", &[]);
    assert_eq!(output.code, Some(0), "all marks are there: {output:?}");
    for moment in ["take-over", "restore", "save"] {
        std::fs::remove_file(fixture.path(&format!("damper {moment}"))).unwrap();
    }
    let output = fixture.run("stopped for good", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output
            .err
            .contains("participant `damper`: was ended by signal 6 (abort) when it was given its part of the plan"),
        "{output:?}"
    );
}

/// A run in which the plant is substituted at 1 s, and the damper dies at its relocate request.
fn run_dying_at_relocate(more: &[&str]) -> (RunFixture, escapement_tests::program::ProgramOutput) {
    let faults = substitution("1 s", "oscillator", "keep").replace("\"damper\"", "\"plant\"");
    let fixture = RunFixture::with_appended("asked", "damper", &faults);
    let exe = participant("violates").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [\"dies-on-move\"] }}");
    let output = fixture.run("run", &[&["--set", &runs], more].concat());
    (fixture, output)
}

#[test]
fn participant_that_dies_at_a_relocate_request_is_named() {
    let (_, output) = run_dying_at_relocate(&[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output
            .err
            .contains("participant `damper`: was ended by signal 6 (abort) when it was asked to move"),
        "{output:?}"
    );
}

#[test]
fn participant_that_dies_at_a_relocate_request_is_replaced() {
    let damper = participant("damper").display().to_string();
    let substitute = policy("damper", &format!("{{ substitute = {{ exe = {damper:?} }} }}"));
    let (fixture, output) = run_dying_at_relocate(&["--set", &substitute]);
    assert_eq!(output.code, Some(0), "{output:?}");
    // The offending participant counts from 0; the substitute from 1.
    assert_eq!((fixture.count("run", 99), fixture.count("run", 100)), (99, 1));
    assert_eq!(fixture.count("run", 999), 900);
    let events = fixture.events("run");
    assert!(
        events.contains("activation 100 from its initial state, because of a failure: was ended"),
        "{events}"
    );
    assert_eq!(events.matches("\"substitution\"").count(), 2, "{events}");
}

#[test]
fn participant_that_dies_in_every_relocation_ends_the_run() {
    let fixture = RunFixture::new("always", "damper");
    let exe = participant("dies").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [\"always\", \"late\", \"restore\"] }}");
    let output = fixture.run(
        "run",
        &[
            "--set",
            &runs,
            "--set",
            &policy("damper", BACK),
            "--checkpoint-every",
            "2 s",
        ],
    );
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("restarted 5 times without progress"), "{output:?}");
    // Nothing is lost: the results from before its first death are there.
    assert_eq!(fixture.assert_prefix("run"), 450);
}

#[test]
fn death_in_relocation_without_a_policy_ends_the_run() {
    let fixture = RunFixture::new("stop", "damper");
    let (plant, damper) = (
        run_dying(&fixture, "plant", &["late"]),
        run_dying(&fixture, "damper", &["restore"]),
    );
    let policy = policy("plant", BACK);
    let output = fixture.run(
        "run",
        &[
            "--set",
            &plant,
            "--set",
            &damper,
            "--set",
            &policy,
            "--checkpoint-every",
            "2 s",
        ],
    );
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "participant `damper`: was ended by signal 6",
        "when the run was to go on after participant `plant`",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    fixture.assert_prefix("run");
}

#[test]
fn other_ports_after_a_restart_are_refused_with_the_difference() {
    let fixture = RunFixture::new("changes_interface", "damper");
    let exe = participant("changes_interface").display().to_string();
    let mark = fixture.path("mark").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [{mark:?}] }}");
    let output = fixture.run("run", &["--set", &runs, "--set", &policy("damper", BACK)]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in ["participant `damper`: describes other ports than expected", "kN"] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    assert_eq!(fixture.assert_prefix("run"), 200);
}

#[test]
fn participant_that_dies_in_set_up_is_restarted() {
    for slot in ["plant", "damper"] {
        let fixture = RunFixture::new("unborn", "damper");
        let (runs, policy) = (run_dying(&fixture, slot, &["made"]), policy(slot, BACK));
        let output = fixture.run("run", &["--set", &runs, "--set", &policy]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert!(output.err.contains("when it was given its parameters"), "{output:?}");
        fixture.assert_same_as_undisturbed("run");
        assert!(fixture.events("run").contains("started again before the run began"));
        // The log lines of both programs are kept.
        let logs = std::fs::read_dir(fixture.path("run/log")).unwrap().flatten();
        let of_slot = |name: &String| name.starts_with(&format!("{slot}."));
        let logs: Vec<String> = logs
            .filter_map(|log| log.file_name().into_string().ok())
            .filter(of_slot)
            .collect();
        assert_eq!(logs.len(), 2, "{logs:?}");
    }
}

#[test]
fn participant_that_dies_at_resume_is_restarted() {
    let fixture = RunFixture::new("awakening", "damper");
    let (runs, policy) = (run_dying(&fixture, "damper", &["restore"]), policy("damper", BACK));
    let output = fixture.run("run", &["--set", &runs, "--set", &policy, "--checkpoint-at", "4 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = fixture.resume("run", "resumed", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("when it was given its part of the plan"),
        "{output:?}"
    );
    fixture.assert_same_as_undisturbed("resumed");
}

#[test]
fn participant_that_always_dies_in_set_up_is_replaced() {
    let fixture = RunFixture::new("never", "damper");
    let exe = participant("dies").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [\"always\", \"made\"] }}");
    let output = fixture.run("given up", &["--set", &runs, "--set", &policy("damper", BACK)]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("started again 5 times without getting any further"),
        "{output:?}"
    );
    let spare = participant("damper").display().to_string();
    let spare = format!("participants.damper.on-failure={{ substitute = {{ exe = {spare:?} }} }}");
    let output = fixture.run("replaced", &["--set", &runs, "--set", &spare]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("replaced");
    assert!(fixture.events("replaced").contains("takes over before the run began"));
    let output = fixture.run("ended", &["--set", &runs]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(!output.err.contains("started again"), "{output:?}");
}
