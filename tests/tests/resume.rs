//! Runs that are continued from the middle: from a checkpoint, after a death, with a substitute.

use escapement_tests::fixture::{RunFixture, substitution};
use escapement_tests::machine::{processes_of, send_signal, wait_for_bytes, wait_until, writer_of};
use escapement_tests::program::{
    ProgramOutput, participant, run_orchestrator, start_orchestrator, text, wait_for_output,
};
use rustix::process::Signal;

#[test]
fn resumed_run_has_the_undisturbed_tape() {
    let fixture = RunFixture::new("resume", "damper");
    let output = fixture.run("saved", &["--checkpoint-every", "3 s", "--checkpoint-at", "1/3 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("saved");
    for (number, from) in ["334 ms", "5 s", "6 s", "20 s"].iter().enumerate() {
        let name = format!("resumed{number}");
        let output = fixture.resume("saved", &name, &["--from", from]);
        assert_eq!(output.code, Some(0), "{output:?}");
        fixture.assert_same_as_undisturbed(&name);
    }
    // A resumed run can be saved and resumed again.
    let output = fixture.resume("saved", "again", &["--from", "3 s", "--checkpoint-at", "4 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = fixture.resume("again", "and again", &["--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let summary = output.json();
    let number = |key: &str| summary[key].as_f64().unwrap();
    assert_eq!(number("resumed_from_s"), 4.0);
    // the speed is that of what this run itself simulated
    let own = number("simulated_time_s") - 4.0;
    assert!(
        (number("real_time_factor") * number("wall_time_s") - own).abs() < 1e-6,
        "{summary}"
    );
    fixture.assert_same_as_undisturbed("and again");
}

#[test]
fn longer_duration_continues_past_the_end() {
    let fixture = RunFixture::new("longer", "damper");
    assert_eq!(
        fixture
            .run("saved", &["--duration", "4 s", "--checkpoint-at", "3 s"])
            .code,
        Some(0)
    );
    assert_eq!(fixture.resume("saved", "whole", &["--duration", "10 s"]).code, Some(0));
    fixture.assert_same_as_undisturbed("whole");
}

#[test]
fn branch_with_a_change_differs_from_its_checkpoint_on() {
    let fixture = RunFixture::new("branch", "damper");
    assert_eq!(fixture.run("saved", &["--checkpoint-at", "4 s"]).code, Some(0));
    let output = fixture.resume("saved", "late", &["--set", "connections.push.delay=25ms"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let motion = |name: &str| std::fs::read(fixture.path(name).join("tape/plant.motion.bin")).unwrap();
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
        let fixture = RunFixture::with_appended("branch-at", "damper", &substitution(from, "out_of_range", "keep"));
        assert_eq!(fixture.run("itself", &[]).code, Some(0));
        let plain = RunFixture::new("branch-of", "damper");
        assert_eq!(plain.run("saved", &["--checkpoint-every", "2 s"]).code, Some(0));
        let program = format!(
            "participants.damper.run={{ exe = '{}' }}",
            participant("out_of_range").display()
        );
        let output = plain.resume("saved", "branch", &["--from", from, "--set", &program]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let output = run_orchestrator(&["compare", text(&fixture.path("itself")), text(&plain.path("branch"))]);
        assert_eq!(output.code, Some(0), "{from}: {output:?}");
        assert_contains_only(&plain, &["oscillator.toml", "undisturbed", "saved", "branch"]);
    }
}

/// Checks that the folder of `fixture` contains only `names`.
fn assert_contains_only(fixture: &RunFixture, names: &[&str]) {
    let all = std::fs::read_dir(fixture.folder.path()).unwrap();
    let all: std::collections::BTreeSet<String> = all
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(all, names.iter().map(|name| (*name).to_owned()).collect());
}

#[test]
fn branch_without_a_change_has_the_tape_of_the_run() {
    let fixture = RunFixture::new("branch-none", "damper");
    assert_eq!(fixture.run("saved", &["--checkpoint-every", "3 s"]).code, Some(0));
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
        let output = fixture.resume("saved", &name, &more);
        if from == "1/3 s" {
            assert_eq!(output.code, Some(2), "no checkpoint comes before: {output:?}");
            continue;
        }
        assert_eq!(output.code, Some(0), "{output:?}");
        fixture.assert_same_as_undisturbed(&name);
    }
    // An instant that rounds up to the end is refused with the option that named it.
    let output = fixture.resume("saved", "late", &["--from", "9.9995 s", "--set", "title=Unchanged"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("error: --from 9999500 us"), "{output:?}");
    assert!(!output.err.contains("--checkpoint-at"), "{output:?}");
}

/// A branch is killed on the way to its start: the folder that it uses for that is found and removed, and not before.
#[test]
fn leftovers_of_a_killed_branch_are_removed() {
    let fixture = RunFixture::new("branch-killed", "slow");
    let output = fixture.run("saved", &["--checkpoint-at", "1 s", "--duration", "2 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let branches = || -> Vec<std::path::PathBuf> {
        let all = std::fs::read_dir(fixture.folder.path()).unwrap();
        let all = all.map(|entry| entry.unwrap().path());
        all.filter(|path| path.file_name().unwrap().as_encoded_bytes().starts_with(b".branch-"))
            .collect()
    };
    let (run, out) = (fixture.path("saved"), fixture.path("out"));
    for removed_by_a_run in [false, true] {
        let to = ["--out", text(&out), "--duration", "1 h", "--from", "3000 s"];
        let change = ["--set", "connections.push.delay=25ms"];
        let mut child = start_orchestrator(&[&["resume", text(&run)], &to[..], &change].concat());
        wait_until(&mut child, "there is no branch", || !branches().is_empty());
        let branch = branches().remove(0);
        wait_for_bytes(&mut child, &branch.join("tape/plant.motion.bin"), 24);
        assert_eq!(run_orchestrator(&["doctor", "--remove"]).code, Some(0));
        assert!(branch.exists(), "it is removed while its run lives");
        send_signal(child.id(), Signal::KILL);
        assert_eq!(wait_for_output(child).code, None);
        if removed_by_a_run {
            let output = fixture.run("next", &["--duration", "10 ms"]);
            assert_eq!(output.code, Some(0), "{output:?}");
        } else {
            // Runs of other tests clean up as well.
            let output = run_orchestrator(&["doctor", "--remove"]);
            let reported = output.out.contains(text(&branch));
            assert!(output.code == Some(0) && (reported || !branch.exists()), "{output:?}");
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
    let fixture = RunFixture::new("branch-same", "damper");
    for (name, every) in [("often", "1 s"), ("rarely", "3 s")] {
        assert_eq!(fixture.run(name, &["--checkpoint-every", every]).code, Some(0));
    }
    let change = ["--from", "5 s", "--set", "connections.push.delay=25ms"];
    for (run, branch) in [("often", "at"), ("rarely", "behind")] {
        let output = fixture.resume(run, branch, &change);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    let [at, behind] = ["at", "behind"].map(|name| fixture.path(name));
    let output = run_orchestrator(&["compare", text(&at), text(&behind)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    // Up to the branch the samples equal those of the run; 25 ms later at the latest they differ.
    let motion = |name: &str| std::fs::read(fixture.path(name).join("tape/plant.motion.bin")).unwrap();
    let (undisturbed, branch) = (motion("undisturbed"), motion("behind"));
    assert_eq!(undisturbed[..5001 * 24], branch[..5001 * 24]);
    assert_ne!(undisturbed[5001 * 24..5030 * 24], branch[5001 * 24..5030 * 24]);
    // Impossible requests are rejected, and nothing is left behind.
    let output = fixture.resume(
        "rarely",
        "late",
        &["--from", "10 s", "--set", "connections.push.delay=25ms"],
    );
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("--from 10 s") && output.err.contains("is not before the end at 10 s"),
        "{output:?}"
    );
    assert_contains_only(
        &fixture,
        &["oscillator.toml", "undisturbed", "often", "rarely", "at", "behind"],
    );
}

#[test]
fn invalid_resume_is_refused() {
    let fixture = RunFixture::new("refused", "damper");
    assert_eq!(fixture.run("saved", &["--checkpoint-at", "4 s"]).code, Some(0));
    let output = fixture.resume("saved", "early", &["--from", "1 s"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("at or before 1 s") && output.err.contains("one at 4 s"),
        "{output:?}"
    );
    let output = fixture.resume("undisturbed", "none", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("--checkpoint-every"), "{output:?}");
    let output = fixture.resume("nowhere", "none", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
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
            let output = fixture.resume("saved", "other", &[more, way].concat());
            assert_eq!(output.code, Some(2), "{output:?}");
            let key = if key == "duration" {
                "duration: ".to_owned()
            } else {
                format!("participants.damper.{key}: ")
            };
            assert!(output.err.contains(&key), "`{key}` is not in {output:?}");
            for part in parts {
                assert!(output.err.contains(part), "`{part}` is not in {output:?}");
            }
            assert!(!fixture.path("other").exists(), "nothing is written");
        }
    }
    let file = fixture.path("saved/checkpoints/4s.checkpoint");
    let mut bytes = std::fs::read(&file).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let output = fixture.resume("saved", "damaged", &[]);
    assert!(
        output.err.contains("4s.checkpoint") && output.err.contains("checksum"),
        "{output:?}"
    );
}

#[test]
fn damaged_checkpoint_is_named_and_an_earlier_one_is_used() {
    let fixture = RunFixture::new("skipped", "damper");
    let made = fixture.run("saved", &["--checkpoint-at", "3 s", "--checkpoint-at", "4 s"]);
    assert_eq!(made.code, Some(0), "{made:?}");
    std::fs::write(fixture.path("saved/checkpoints/4s.checkpoint"), "").unwrap();
    let output = fixture.resume("saved", "resumed", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for part in ["warning: ", "4s.checkpoint", "left out", "checkpoint at t = 3"] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    fixture.assert_same_as_undisturbed("resumed");
}

#[test]
fn participant_that_cannot_be_saved_is_named() {
    let fixture = RunFixture::new("not_saveable", "not_saveable");
    let output = fixture.run("saved", &["--checkpoint-at", "4 s"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("`damper`: cannot save its state"), "{output:?}");
}

/// Kills `participant_name` once in a paced run with the restart policy.
fn run_and_kill(fixture: &RunFixture, name: &str, participant_name: &str, how: Signal) -> ProgramOutput {
    let out = fixture.path(name);
    let mut child = start_orchestrator(&[
        "run",
        text(&fixture.scenario),
        "--out",
        text(&out),
        "--real-time=8",
        "--checkpoint-every",
        "2 s",
        "--patience",
        "1 s",
        "--set",
        &format!("participants.{participant_name}.on-failure=restart-from-checkpoint"),
    ]);
    // At 4.5 s of 10: some time after a checkpoint and, where there is one, after the substitution.
    wait_for_bytes(&mut child, &out.join("tape/damper.push.bin"), 24 * 450);
    let pid = writer_of(&out.join("log").join(format!("{participant_name}.stderr"))).expect("the participant runs");
    assert!(send_signal(pid, how));
    let output = wait_for_output(child);
    assert_eq!(
        processes_of(fixture.folder.path()),
        Vec::<String>::new(),
        "processes are left"
    );
    output
}

#[test]
fn restarted_run_has_the_undisturbed_tape() {
    let fixture = RunFixture::new("restart", "damper");
    for (name, participant_name, how) in [
        ("killed damper", "damper", Signal::KILL),
        ("killed plant", "plant", Signal::KILL),
        ("stopped damper", "damper", Signal::STOP),
        ("terminated plant", "plant", Signal::TERM),
    ] {
        let output = run_and_kill(&fixture, name, participant_name, how);
        assert_eq!(output.code, Some(0), "{output:?}");
        fixture.assert_same_as_undisturbed(name);
        let events = fixture.events(name);
        assert!(
            events.contains("\"restart\"") && events.contains("from the checkpoint at t = "),
            "{events}"
        );
    }
}

#[test]
fn repeatedly_failing_participant_ends_the_run() {
    let fixture = RunFixture::new("hopeless", "crash_at");
    let policy = "participants.damper.on-failure=restart-from-checkpoint";
    let output = fixture.run("run", &["--set", policy]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("signal 6") && output.err.contains("restarted 5 times"),
        "{output:?}"
    );
    assert_eq!(fixture.assert_prefix("run"), 200);
}

#[test]
fn participant_that_differs_after_a_restart_is_named() {
    let fixture = RunFixture::new("nondeterministic", "nondeterministic");
    let output = run_and_kill(&fixture, "run", "damper", Signal::KILL);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("`damper`: is not deterministic") && output.err.contains("force = "),
        "{output:?}"
    );
}

#[test]
fn substitute_takes_over_from_the_failed_participant() {
    for bad in ["crash_at", "hangs", "nan", "panics", "exit_at"] {
        let fixture = RunFixture::new(bad, bad);
        let good = participant("damper");
        let policy = format!(
            "participants.damper.on-failure={{ substitute = {{ exe = \"{}\" }} }}",
            good.display()
        );
        let output = fixture.run("run", &["--set", &policy, "--patience", "1 s"]);
        assert_eq!(output.code, Some(0), "{bad}: {output:?}");
        // It starts without state at the activation that the other one did not finish.
        assert_eq!(
            (fixture.count("run", 199), fixture.count("run", 200)),
            (200, 1),
            "{bad}"
        );
        assert_eq!(fixture.count("run", 999), 800, "{bad}");
        let events = fixture.events("run");
        assert!(
            events.contains("`damper` takes over at activation 200"),
            "{bad}: {events}"
        );
    }
}

#[test]
fn substitute_in_mid_run_starts_anew_or_keeps_the_state() {
    let fixture = RunFixture::with_appended("cold", "damper", &substitution("2.005 s", "damper", "cold"));
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    // Activations at 0 … 2 s are those of the old program; the one at 2.01 s is the first of the new one.
    assert_eq!((fixture.count("run", 200), fixture.count("run", 201)), (201, 1));
    assert_eq!(fixture.count("run", 999), 799);
    let events = fixture.events("run");
    assert!(
        events.contains("\"substitution\"") && events.contains("activation 201 from its initial state"),
        "{events}"
    );

    // With the state of its predecessor the replacement leaves no trace, however often it happens.
    let twice = substitution("2 s", "damper", "keep") + &substitution("7/3 s", "damper", "keep");
    let fixture = RunFixture::with_appended("keep", "damper", &twice);
    let output = fixture.run("run", &["--checkpoint-every", "1 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    assert_eq!(fixture.events("run").lines().count(), 2);
    // A run that continues from before, between and after still has the remaining substitutions to come.
    for (from, left) in [("1 s", 2), ("2 s", 2), ("3 s", 2)] {
        let name = format!("from {from}");
        let output = fixture.resume("run", &name, &["--from", from]);
        assert_eq!(output.code, Some(0), "{output:?}");
        fixture.assert_same_as_undisturbed(&name);
        let events = fixture.events(&name);
        assert_eq!(events.matches("\"substitution\"").count(), left, "{from}: {events}");
    }
}

#[test]
fn substitute_with_other_ports_is_refused_with_the_difference() {
    // Checked before anything runs, for every substitute, at a given time or after a failure.
    let fixture = RunFixture::with_appended("ports", "damper", &substitution("2 s", "wrong_descriptor", "cold"));
    let wrong = participant("wrong_descriptor").display().to_string();
    let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {wrong:?} }} }}");
    let other = RunFixture::new("policy", "damper");
    for (output, key) in [
        (fixture.run("run", &[]), "faults.fault-1"),
        (other.run("run", &["--set", &policy]), "participants.damper.on-failure"),
    ] {
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in [key, "`wrong_descriptor` has other ports than `damper`", "kN"] {
            assert!(output.err.contains(part), "`{part}` is not in {output:?}");
        }
    }
    // And once more at the substitution: a program that has described the right ports before may describe others then.
    let fixture = RunFixture::with_appended(
        "changes_interface",
        "damper",
        &substitution("1 s", "changes_interface", "cold"),
    );
    let mark = format!("args = [{:?}] }}", fixture.path("mark"));
    let scenario = std::fs::read_to_string(&fixture.scenario).unwrap();
    std::fs::write(
        &fixture.scenario,
        scenario.replace("/changes_interface\" }", &format!("/changes_interface\", {mark}")),
    )
    .unwrap();
    let output = fixture.run("run", &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in ["participant `damper`: describes other ports than expected", "kN"] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    assert_eq!(fixture.assert_prefix("run"), 100);
}

#[test]
fn restart_never_returns_to_before_a_substitution() {
    let fixture = RunFixture::with_appended("order", "damper", &substitution("2.5 s", "damper", "keep"));
    let output = run_and_kill(&fixture, "run", "plant", Signal::KILL);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
}
