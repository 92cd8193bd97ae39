//! Runs that are continued from the middle: from a checkpoint, after a death, with a substitute.

use escapement_tests::machine::{processes_of, signal, wait_for_bytes, wait_until, writer_of};
use escapement_tests::program::{Said, finish, orchestrate, participant, start, text};
use escapement_tests::world::{World, substitution};
use rustix::process::Signal;

#[test]
fn resumed_run_has_the_undisturbed_tape() {
    let world = World::new("resume", "damper");
    let said = world.run("saved", &["--checkpoint-every", "3 s", "--checkpoint-at", "1/3 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("saved");
    for (number, from) in ["334 ms", "5 s", "6 s", "20 s"].iter().enumerate() {
        let name = format!("resumed{number}");
        let said = world.resume("saved", &name, &["--from", from]);
        assert_eq!(said.code, Some(0), "{said:?}");
        world.same_as_undisturbed(&name);
    }
    // A resumed run can be saved and resumed again.
    let said = world.resume("saved", "again", &["--from", "3 s", "--checkpoint-at", "4 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let said = world.resume("again", "and again", &["--json"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("and again");
}

#[test]
fn longer_duration_continues_past_the_end() {
    let world = World::new("longer", "damper");
    assert_eq!(
        world
            .run("saved", &["--duration", "4 s", "--checkpoint-at", "3 s"])
            .code,
        Some(0)
    );
    assert_eq!(world.resume("saved", "whole", &["--duration", "10 s"]).code, Some(0));
    world.same_as_undisturbed("whole");
}

#[test]
fn branch_with_a_change_differs_from_its_checkpoint_on() {
    let world = World::new("branch", "damper");
    assert_eq!(world.run("saved", &["--checkpoint-at", "4 s"]).code, Some(0));
    let said = world.resume("saved", "late", &["--set", "connections.push.delay=25ms"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let motion = |name: &str| std::fs::read(world.path(name).join("tape/plant.motion.bin")).unwrap();
    let (undisturbed, branch) = (motion("undisturbed"), motion("late"));
    // 4000 steps and the sample before the first are the same; the following ones differ.
    assert_eq!(undisturbed[..4001 * 24], branch[..4001 * 24]);
    assert_ne!(undisturbed, branch);
    assert_eq!(undisturbed.len(), branch.len());
}

#[test]
fn branch_after_a_checkpoint_equals_a_declared_substitution() {
    // The other program pushes with 90 N from its first step on.
    for from in ["4.123 s", "4 s", "9.99 s"] {
        let world = World::with("branch-at", "damper", &substitution(from, "out_of_range", "keep"));
        assert_eq!(world.run("itself", &[]).code, Some(0));
        let plain = World::new("branch-of", "damper");
        assert_eq!(plain.run("saved", &["--checkpoint-every", "2 s"]).code, Some(0));
        let program = format!(
            "participants.damper.run={{ exe = '{}' }}",
            participant("out_of_range").display()
        );
        let said = plain.resume("saved", "branch", &["--from", from, "--set", &program]);
        assert_eq!(said.code, Some(0), "{said:?}");
        let said = orchestrate(&["compare", text(&world.path("itself")), text(&plain.path("branch"))]);
        assert_eq!(said.code, Some(0), "{from}: {said:?}");
        assert_nothing_beside(&plain, &["oscillator.toml", "undisturbed", "saved", "branch"]);
    }
}

/// Checks that the folder of `world` contains only `names`.
fn assert_nothing_beside(world: &World, names: &[&str]) {
    let all = std::fs::read_dir(world.folder.path()).unwrap();
    let all: std::collections::BTreeSet<String> = all
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(all, names.iter().map(|name| (*name).to_owned()).collect());
}

#[test]
fn branch_without_a_change_has_the_tape_of_the_run() {
    let world = World::new("branch-none", "damper");
    assert_eq!(world.run("saved", &["--checkpoint-every", "3 s"]).code, Some(0));
    for (number, from) in ["3 s", "5.0005 s", "1/3 s", "9.999 s"].into_iter().enumerate() {
        let more = [
            "--from",
            from,
            "--set",
            "title=Unchanged",
            "--set",
            "connections.push.delay=0ms",
        ];
        let name = format!("branch{number}");
        let said = world.resume("saved", &name, &more);
        if from == "1/3 s" {
            assert_eq!(said.code, Some(2), "no checkpoint comes before: {said:?}");
            continue;
        }
        assert_eq!(said.code, Some(0), "{said:?}");
        world.same_as_undisturbed(&name);
    }
    // An instant that rounds up to the end is refused with the option that named it.
    let said = world.resume("saved", "late", &["--from", "9.9995 s", "--set", "title=Unchanged"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("error: --from 9999500 us"), "{said:?}");
    assert!(!said.err.contains("--checkpoint-at"), "{said:?}");
}

/// A branch is killed on the way to its start: the folder that it uses for that is found and removed, and not before.
#[test]
fn leftovers_of_a_killed_branch_are_removed() {
    let world = World::new("branch-killed", "slow");
    let said = world.run("saved", &["--checkpoint-at", "1 s", "--duration", "2 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let branches = || -> Vec<std::path::PathBuf> {
        let all = std::fs::read_dir(world.folder.path()).unwrap();
        let all = all.map(|entry| entry.unwrap().path());
        all.filter(|path| path.file_name().unwrap().as_encoded_bytes().starts_with(b".branch-"))
            .collect()
    };
    let (run, out) = (world.path("saved"), world.path("out"));
    for removed_by_a_run in [false, true] {
        let to = ["--out", text(&out), "--duration", "1 h", "--from", "3000 s"];
        let change = ["--set", "connections.push.delay=25ms"];
        let mut child = start(&[&["resume", text(&run)], &to[..], &change].concat());
        wait_until(&mut child, "there is no branch", || !branches().is_empty());
        let branch = branches().remove(0);
        wait_for_bytes(&mut child, &branch.join("tape/plant.motion.bin"), 24);
        assert_eq!(orchestrate(&["doctor", "--remove"]).code, Some(0));
        assert!(branch.exists(), "it is removed while its run lives");
        signal(child.id(), Signal::KILL);
        assert_eq!(finish(child).code, None);
        if removed_by_a_run {
            let said = world.run("next", &["--duration", "10 ms"]);
            assert_eq!(said.code, Some(0), "{said:?}");
        } else {
            // Runs of other tests clean up as well.
            let said = orchestrate(&["doctor", "--remove"]);
            let told = said.out.contains(text(&branch));
            assert!(said.code == Some(0) && (told || !branch.exists()), "{said:?}");
        }
        let begun = std::time::Instant::now();
        while branch.exists() {
            assert!(begun.elapsed().as_secs() < 60, "{} is left", branch.display());
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
    }
}

#[test]
fn branch_does_not_depend_on_the_checkpoint_before_it() {
    let world = World::new("branch-same", "damper");
    for (name, every) in [("often", "1 s"), ("rarely", "3 s")] {
        assert_eq!(world.run(name, &["--checkpoint-every", every]).code, Some(0));
    }
    let change = ["--from", "5 s", "--set", "connections.push.delay=25ms"];
    for (run, branch) in [("often", "at"), ("rarely", "behind")] {
        let said = world.resume(run, branch, &change);
        assert_eq!(said.code, Some(0), "{said:?}");
    }
    let [at, behind] = ["at", "behind"].map(|name| world.path(name));
    let said = orchestrate(&["compare", text(&at), text(&behind)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    // Up to the branch the samples equal those of the run; 25 ms later at the latest they differ.
    let motion = |name: &str| std::fs::read(world.path(name).join("tape/plant.motion.bin")).unwrap();
    let (undisturbed, branch) = (motion("undisturbed"), motion("behind"));
    assert_eq!(undisturbed[..5001 * 24], branch[..5001 * 24]);
    assert_ne!(undisturbed[5001 * 24..5030 * 24], branch[5001 * 24..5030 * 24]);
    // Impossible requests are rejected, and nothing is left behind.
    let said = world.resume(
        "rarely",
        "late",
        &["--from", "10 s", "--set", "connections.push.delay=25ms"],
    );
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(
        said.err.contains("--from 10 s") && said.err.contains("is not before the end at 10 s"),
        "{said:?}"
    );
    assert_nothing_beside(
        &world,
        &["oscillator.toml", "undisturbed", "often", "rarely", "at", "behind"],
    );
}

#[test]
fn invalid_resume_is_refused() {
    let world = World::new("refused", "damper");
    assert_eq!(world.run("saved", &["--checkpoint-at", "4 s"]).code, Some(0));
    let said = world.resume("saved", "early", &["--from", "1 s"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(
        said.err.contains("at or before 1 s") && said.err.contains("one at 4 s"),
        "{said:?}"
    );
    let said = world.resume("undisturbed", "none", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("--checkpoint-every"), "{said:?}");
    let said = world.resume("nowhere", "none", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let rate = ["--set", "participants.damper.period=20ms"];
    let offset = ["--set", "participants.damper.offset=15ms"];
    let later = [&["--from", "6 s"], &rate[..]].concat();
    for (more, key, parts) in [
        (
            &rate[..],
            "period",
            ["200 activations", "400 in the run", "given with --set"],
        ),
        (
            &offset,
            "offset",
            ["399 activations", "400 in the run", "given with --set"],
        ),
        // From an instant between two checkpoints: nothing is run up to there.
        (
            &later,
            "period",
            ["300 activations", "600 in the run", "given with --set"],
        ),
        (
            &["--duration", "3 s"],
            "duration",
            ["t = 4 s", "--from", "given with --duration"],
        ),
    ] {
        for way in [&[][..], &["--in-process"]] {
            let said = world.resume("saved", "other", &[more, way].concat());
            assert_eq!(said.code, Some(2), "{said:?}");
            let key = if key == "duration" {
                "duration: ".to_owned()
            } else {
                format!("participants.damper.{key}: ")
            };
            assert!(said.err.contains(&key), "`{key}` is not in {said:?}");
            for part in parts {
                assert!(said.err.contains(part), "`{part}` is not in {said:?}");
            }
            assert!(!world.path("other").exists(), "nothing is written");
        }
    }
    let file = world.path("saved/checkpoints/4s.checkpoint");
    let mut bytes = std::fs::read(&file).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let said = world.resume("saved", "damaged", &[]);
    assert!(
        said.err.contains("4s.checkpoint") && said.err.contains("checksum"),
        "{said:?}"
    );
}

#[test]
fn a_damaged_checkpoint_is_named_where_an_earlier_one_is_taken() {
    let world = World::new("skipped", "damper");
    let made = world.run("saved", &["--checkpoint-at", "3 s", "--checkpoint-at", "4 s"]);
    assert_eq!(made.code, Some(0), "{made:?}");
    std::fs::write(world.path("saved/checkpoints/4s.checkpoint"), "").unwrap();
    let said = world.resume("saved", "resumed", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    for part in ["warning: ", "4s.checkpoint", "left out", "checkpoint at t = 3"] {
        assert!(said.err.contains(part), "`{part}` is not in {said:?}");
    }
    world.same_as_undisturbed("resumed");
}

#[test]
fn participant_that_cannot_be_saved_is_named() {
    let world = World::new("forgetful", "forgetful");
    let said = world.run("saved", &["--checkpoint-at", "4 s"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("`damper`: cannot save its state"), "{said:?}");
}

/// Kills `who` once in a paced run with the restart policy.
fn killed(world: &World, name: &str, who: &str, how: Signal) -> Said {
    let out = world.path(name);
    let mut child = start(&[
        "run",
        text(&world.scenario),
        "--out",
        text(&out),
        "--real-time=8",
        "--checkpoint-every",
        "2 s",
        "--patience",
        "1 s",
        "--set",
        &format!("participants.{who}.on-failure=restart-from-checkpoint"),
    ]);
    // At 4.5 s of 10: some time after a checkpoint and, where there is one, after the substitution.
    wait_for_bytes(&mut child, &out.join("tape/damper.push.bin"), 24 * 450);
    let pid = writer_of(&out.join("log").join(format!("{who}.stderr"))).expect("the participant runs");
    assert!(signal(pid, how));
    let said = finish(child);
    assert_eq!(
        processes_of(world.folder.path()),
        Vec::<String>::new(),
        "processes are left"
    );
    said
}

#[test]
fn restarted_run_has_the_undisturbed_tape() {
    let world = World::new("restart", "damper");
    for (name, who, how) in [
        ("killed damper", "damper", Signal::KILL),
        ("killed plant", "plant", Signal::KILL),
        ("stopped damper", "damper", Signal::STOP),
        ("terminated plant", "plant", Signal::TERM),
    ] {
        let said = killed(&world, name, who, how);
        assert_eq!(said.code, Some(0), "{said:?}");
        world.same_as_undisturbed(name);
        let events = world.events(name);
        assert!(
            events.contains("\"restart\"") && events.contains("from the checkpoint at t = "),
            "{events}"
        );
    }
}

#[test]
fn repeatedly_failing_participant_ends_the_run() {
    let world = World::new("hopeless", "crash_at");
    let policy = "participants.damper.on-failure=restart-from-checkpoint";
    let said = world.run("run", &["--set", policy]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("signal 6") && said.err.contains("restarted 5 times"),
        "{said:?}"
    );
    assert_eq!(world.prefix("run"), 200);
}

#[test]
fn participant_that_differs_after_a_restart_is_named() {
    let world = World::new("moody", "moody");
    let said = killed(&world, "run", "damper", Signal::KILL);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.err.contains("`damper`: is not deterministic") && said.err.contains("force = "),
        "{said:?}"
    );
}

#[test]
fn substitute_takes_over_from_the_failed_participant() {
    for bad in ["crash_at", "hangs", "nan", "panics", "exit_at"] {
        let world = World::new(bad, bad);
        let good = participant("damper");
        let policy = format!(
            "participants.damper.on-failure={{ substitute = {{ exe = \"{}\" }} }}",
            good.display()
        );
        let said = world.run("run", &["--set", &policy, "--patience", "1 s"]);
        assert_eq!(said.code, Some(0), "{bad}: {said:?}");
        // It starts without state at the activation that the other one did not finish.
        assert_eq!((world.count("run", 199), world.count("run", 200)), (200, 1), "{bad}");
        assert_eq!(world.count("run", 999), 800, "{bad}");
        let events = world.events("run");
        assert!(
            events.contains("`damper` takes over at activation 200"),
            "{bad}: {events}"
        );
    }
}

#[test]
fn substitute_in_mid_run_starts_anew_or_keeps_the_state() {
    let world = World::with("cold", "damper", &substitution("2.005 s", "damper", "cold"));
    let said = world.run("run", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    // Activations at 0 … 2 s are those of the old program; the one at 2.01 s is the first of the new one.
    assert_eq!((world.count("run", 200), world.count("run", 201)), (201, 1));
    assert_eq!(world.count("run", 999), 799);
    let events = world.events("run");
    assert!(
        events.contains("\"substitution\"") && events.contains("activation 201 from its initial state"),
        "{events}"
    );

    // With the state of its predecessor the replacement leaves no trace, however often it happens.
    let twice = substitution("2 s", "damper", "keep") + &substitution("7/3 s", "damper", "keep");
    let world = World::with("keep", "damper", &twice);
    let said = world.run("run", &["--checkpoint-every", "1 s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("run");
    assert_eq!(world.events("run").lines().count(), 2);
    // A run that continues from before, between and after still has the remaining substitutions to come.
    for (from, left) in [("1 s", 2), ("2 s", 2), ("3 s", 2)] {
        let name = format!("from {from}");
        let said = world.resume("run", &name, &["--from", from]);
        assert_eq!(said.code, Some(0), "{said:?}");
        world.same_as_undisturbed(&name);
        let events = world.events(&name);
        assert_eq!(events.matches("\"substitution\"").count(), left, "{from}: {events}");
    }
}

#[test]
fn a_substitute_with_other_ports_is_refused_with_the_difference() {
    // Checked before anything runs, for every substitute, at a given time or after a failure.
    let world = World::with("ports", "damper", &substitution("2 s", "wrong_descriptor", "cold"));
    let wrong = participant("wrong_descriptor").display().to_string();
    let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {wrong:?} }} }}");
    let other = World::new("policy", "damper");
    for (said, key) in [
        (world.run("run", &[]), "faults.fault-1"),
        (other.run("run", &["--set", &policy]), "participants.damper.on-failure"),
    ] {
        assert_eq!(said.code, Some(2), "{said:?}");
        for part in [key, "`wrong_descriptor` has other ports than `damper`", "kN"] {
            assert!(said.err.contains(part), "`{part}` is not in {said:?}");
        }
    }
    // And once more at the substitution: a program that has described the right ports before may describe others then.
    let world = World::with("fickle", "damper", &substitution("1 s", "fickle", "cold"));
    let mark = format!("args = [{:?}] }}", world.path("mark"));
    let scenario = std::fs::read_to_string(&world.scenario).unwrap();
    std::fs::write(
        &world.scenario,
        scenario.replace("/fickle\" }", &format!("/fickle\", {mark}")),
    )
    .unwrap();
    let said = world.run("run", &[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    for part in ["participant `damper`: describes other ports than expected", "kN"] {
        assert!(said.err.contains(part), "`{part}` is not in {said:?}");
    }
    assert_eq!(world.prefix("run"), 100);
}

#[test]
fn restart_never_returns_to_before_a_substitution() {
    let world = World::with("order", "damper", &substitution("2.5 s", "damper", "keep"));
    let said = killed(&world, "run", "plant", Signal::KILL);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("run");
}
