//! Participants that die while all participants are being moved: each such death is one more failure, and follows the policy.

use escapement_tests::program::participant;
use escapement_tests::world::{World, substitution};

/// `--set` of the program in `seat`: `dies` with the folder of its marks and its `moments`.
fn dies(world: &World, seat: &str, moments: &[&str]) -> String {
    let folder = world.folder.path().display().to_string();
    let arguments: Vec<&str> = [&[folder.as_str()], moments].concat();
    let exe = participant("dies").display().to_string();
    format!("participants.{seat}.run={{ exe = {exe:?}, args = {arguments:?} }}")
}

fn policy(seat: &str, policy: &str) -> String {
    format!("participants.{seat}.on-failure={policy}")
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
        let world = World::new("back", "damper");
        let (plant_runs, damper_runs) = (dies(&world, "plant", plant), dies(&world, "damper", damper));
        let (plant_policy, damper_policy) = (policy("plant", BACK), policy("damper", BACK));
        let mut more = vec!["--checkpoint-every", "2 s"];
        for set in [&plant_runs, &damper_runs, &plant_policy, &damper_policy] {
            more.extend(["--set", set]);
        }
        let said = world.run("run", &more);
        assert_eq!(said.code, Some(0), "{plant:?} {damper:?}: {said:?}");
        world.same_as_undisturbed("run");
        for (seat, moment) in plant
            .iter()
            .map(|it| ("plant", it))
            .chain(damper.iter().map(|it| ("damper", it)))
        {
            assert!(
                world.path(&format!("{seat} {moment}")).exists(),
                "{seat} did not die at {moment}"
            );
        }
        assert!(world.events("run").contains("\"restart\""));
    }
}

#[test]
fn participant_that_fails_in_relocation_is_not_replaced() {
    // The substitute would start at the end of the tape, and the others are at the restored checkpoint.
    let world = World::new("rewound", "damper");
    let (plant, damper) = (dies(&world, "plant", &["late"]), dies(&world, "damper", &["restore"]));
    let backup = format!("{{ substitute = {{ exe = '{}' }} }}", participant("damper").display());
    let (back, replaced) = (policy("plant", BACK), policy("damper", &backup));
    let mut more = vec!["--checkpoint-every", "2 s", "--patience", "5 s"];
    for set in [&plant, &damper, &back, &replaced] {
        more.extend(["--set", set]);
    }
    let said = world.run("run", &more);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("run");
    for mark in ["plant late", "damper restore"] {
        assert!(world.path(mark).exists(), "no death: {mark}");
    }
    assert!(!world.events("run").contains("\"substitution\""));
}

#[test]
fn participant_that_dies_in_save_is_relocated_with_the_others() {
    let world = World::new("state", "damper");
    let (runs, policy) = (dies(&world, "damper", &["save"]), policy("damper", BACK));
    let said = world.run("run", &["--set", &runs, "--set", &policy, "--checkpoint-every", "4 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.err.contains("when it was asked for its state"), "{said:?}");
    world.same_as_undisturbed("run");
    // The checkpoint at which it died was completed in the end.
    assert_eq!(world.resume("run", "resumed", &["--from", "4 s"]).code, Some(0));
    world.same_as_undisturbed("resumed");
}

#[test]
fn death_at_the_start_of_a_resumed_run_is_recovered() {
    let world = World::new("resumed", "damper");
    let said = world.run("run", &["--checkpoint-at", "4 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    // Its state is requested before it has stepped in the resumed run.
    let (runs, policy) = (dies(&world, "damper", &["first-save"]), policy("damper", BACK));
    let said = world.resume("run", "resumed", &["--set", &runs, "--set", &policy]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(world.path("damper first-save").exists(), "it did not die");
    world.same_as_undisturbed("resumed");
}

#[test]
fn substitute_that_dies_at_takeover_follows_the_slots_policy() {
    let world = World::with("newcomer", "damper", &substitution("4.5 s", "dies", "keep"));
    let scenario = std::fs::read_to_string(&world.scenario).unwrap();
    let marks = format!(
        "args = [\"{}\", \"take-over\", \"restore\", \"save\"] }}",
        world.folder.path().display()
    );
    let scenario = scenario.replace("/dies\" }", &format!("/dies\", {marks}"));
    std::fs::write(&world.scenario, scenario).unwrap();
    let said = world.run("run", &["--checkpoint-every", "2 s", "--set", &policy("damper", BACK)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("run");
    for moment in ["take-over", "restore", "save"] {
        assert!(
            world.path(&format!("damper {moment}")).exists(),
            "it did not die at {moment}"
        );
    }
    let said = world.run("stopped", &[]);
    assert_eq!(said.code, Some(0), "all marks are there: {said:?}");
    for moment in ["take-over", "restore", "save"] {
        std::fs::remove_file(world.path(&format!("damper {moment}"))).unwrap();
    }
    let said = world.run("stopped for good", &[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err
            .contains("participant `damper`: was ended by signal 6 (abort) when it was given its part of the plan"),
        "{said:?}"
    );
}

/// A run in which the plant is substituted at 1 s, and the damper dies when it is requested to move.
fn asked_to_move(more: &[&str]) -> (World, escapement_tests::program::Said) {
    let faults = substitution("1 s", "oscillator", "keep").replace("\"damper\"", "\"plant\"");
    let world = World::with("asked", "damper", &faults);
    let lies = participant("violates").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {lies:?}, args = [\"dies-on-move\"] }}");
    let said = world.run("run", &[&["--set", &runs], more].concat());
    (world, said)
}

#[test]
fn participant_that_dies_at_a_relocate_request_is_named() {
    let (_, said) = asked_to_move(&[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err
            .contains("participant `damper`: was ended by signal 6 (abort) when it was asked to move"),
        "{said:?}"
    );
}

#[test]
fn participant_that_dies_at_a_relocate_request_is_replaced() {
    let damper = participant("damper").display().to_string();
    let substitute = policy("damper", &format!("{{ substitute = {{ exe = {damper:?} }} }}"));
    let (world, said) = asked_to_move(&["--set", &substitute]);
    assert_eq!(said.code, Some(0), "{said:?}");
    // The offending participant counts from 0; the substitute from 1.
    assert_eq!((world.count("run", 99), world.count("run", 100)), (99, 1));
    assert_eq!(world.count("run", 999), 900);
    let events = world.events("run");
    assert!(
        events.contains("activation 100 from its initial state, because of a failure: was ended"),
        "{events}"
    );
    assert_eq!(events.matches("\"substitution\"").count(), 2, "{events}");
}

#[test]
fn participant_that_dies_in_every_relocation_ends_the_run() {
    let world = World::new("always", "damper");
    let exe = participant("dies").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [\"always\", \"late\", \"restore\"] }}");
    let said = world.run(
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
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("restarted 5 times without progress"), "{said:?}");
    // Nothing is lost: the results from before its first death are there.
    assert_eq!(world.prefix("run"), 450);
}

#[test]
fn death_in_relocation_without_a_policy_ends_the_run() {
    let world = World::new("stop", "damper");
    let (plant, damper) = (dies(&world, "plant", &["late"]), dies(&world, "damper", &["restore"]));
    let policy = policy("plant", BACK);
    let said = world.run(
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
    assert_eq!(said.code, Some(1), "{said:?}");
    for part in [
        "participant `damper`: was ended by signal 6",
        "when the run was to go on after participant `plant`",
    ] {
        assert!(said.err.contains(part), "`{part}` is not in {said:?}");
    }
    world.prefix("run");
}

#[test]
fn other_ports_after_a_restart_are_refused_with_the_difference() {
    let world = World::new("fickle", "damper");
    let exe = participant("fickle").display().to_string();
    let mark = world.path("mark").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [{mark:?}] }}");
    let said = world.run("run", &["--set", &runs, "--set", &policy("damper", BACK)]);
    assert_eq!(said.code, Some(1), "{said:?}");
    for part in ["participant `damper`: describes other ports than expected", "kN"] {
        assert!(said.err.contains(part), "`{part}` is not in {said:?}");
    }
    assert_eq!(world.prefix("run"), 200);
}

#[test]
fn participant_that_dies_in_set_up_is_restarted() {
    for seat in ["plant", "damper"] {
        let world = World::new("unborn", "damper");
        let (runs, policy) = (dies(&world, seat, &["made"]), policy(seat, BACK));
        let said = world.run("run", &["--set", &runs, "--set", &policy]);
        assert_eq!(said.code, Some(0), "{said:?}");
        assert!(said.err.contains("when it was given its parameters"), "{said:?}");
        world.same_as_undisturbed("run");
        assert!(world.events("run").contains("started again before the run began"));
        // The log lines of both programs are kept.
        let logs = std::fs::read_dir(world.path("run/log")).unwrap().flatten();
        let of_seat = |name: &String| name.starts_with(&format!("{seat}."));
        let logs: Vec<String> = logs
            .filter_map(|log| log.file_name().into_string().ok())
            .filter(of_seat)
            .collect();
        assert_eq!(logs.len(), 2, "{logs:?}");
    }
}

#[test]
fn participant_that_dies_at_resume_is_restarted() {
    let world = World::new("awakening", "damper");
    let (runs, policy) = (dies(&world, "damper", &["restore"]), policy("damper", BACK));
    let said = world.run("run", &["--set", &runs, "--set", &policy, "--checkpoint-at", "4 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let said = world.resume("run", "resumed", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.err.contains("when it was given its part of the plan"), "{said:?}");
    world.same_as_undisturbed("resumed");
}

#[test]
fn participant_that_always_dies_in_set_up_is_replaced() {
    let world = World::new("never", "damper");
    let exe = participant("dies").display().to_string();
    let runs = format!("participants.damper.run={{ exe = {exe:?}, args = [\"always\", \"made\"] }}");
    let said = world.run("given up", &["--set", &runs, "--set", &policy("damper", BACK)]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("started again 5 times without getting any further"),
        "{said:?}"
    );
    let spare = participant("damper").display().to_string();
    let spare = format!("participants.damper.on-failure={{ substitute = {{ exe = {spare:?} }} }}");
    let said = world.run("replaced", &["--set", &runs, "--set", &spare]);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("replaced");
    assert!(world.events("replaced").contains("takes over before the run began"));
    let said = world.run("ended", &["--set", &runs]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(!said.err.contains("started again"), "{said:?}");
}
