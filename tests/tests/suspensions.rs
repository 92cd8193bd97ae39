//! Runs that are stopped and continued: time in which the orchestrator did not run is not counted against any participant.

use std::process::Child;
use std::time::Duration;

use escapement_tests::machine::{signal, wait_for_bytes, wait_until, writer_of};
use escapement_tests::program::{finish, participant, start, text};
use escapement_tests::world::World;
use rustix::process::Signal;

/// Longer than the patience of these runs.
const SUSPENSION: Duration = Duration::from_secs(3);

/// A paced run, a tenth of the way done, and the processes of its plant and its damper.
fn under_way(world: &World, name: &str, more: &[&str]) -> (Child, [u32; 2]) {
    let out = world.path(name);
    let mut arguments = vec![
        "run",
        text(&world.scenario),
        "--out",
        text(&out),
        "--real-time=5",
        "--patience",
        "1 s",
    ];
    arguments.extend(more);
    let mut run = start(&arguments);
    wait_for_bytes(&mut run, &out.join("tape/damper.push.bin"), 24 * 100);
    let pid = |who: &str| writer_of(&out.join("log").join(format!("{who}.stderr"))).expect("the participant runs");
    let both = [pid("plant"), pid("damper")];
    (run, both)
}

/// `--set` of a substitute for the damper in case it fails.
fn substitute() -> String {
    let exe = participant("damper");
    format!(
        "participants.damper.on-failure={{ substitute = {{ exe = '{}' }} }}",
        exe.display()
    )
}

#[test]
fn a_suspension_beyond_patience_changes_nothing() {
    let world = World::new("suspended", "damper");
    let policy = substitute();
    // The orchestrator alone, as by Ctrl-Z, and all processes, as by a paused container.
    let alone = ["alone", "alone with a policy"];
    let all = ["all", "all with a policy"];
    let policies = [&[][..], &["--set", &policy]];
    let mut runs = Vec::new();
    for (names, everything) in [(alone, false), (all, true)] {
        for (name, more) in names.into_iter().zip(policies) {
            let (run, participants) = under_way(&world, name, more);
            signal(run.id(), Signal::STOP);
            let others = if everything { participants.to_vec() } else { Vec::new() };
            others.iter().for_each(|&pid| assert!(signal(pid, Signal::STOP)));
            runs.push((name, run, others));
        }
    }
    std::thread::sleep(SUSPENSION);
    for (_, run, others) in &runs {
        others.iter().for_each(|&pid| assert!(signal(pid, Signal::CONT)));
        signal(run.id(), Signal::CONT);
    }
    for (name, run, _) in runs {
        let said = finish(run);
        assert_eq!(said.code, Some(0), "{name}: {said:?}");
        assert!(!said.err.contains("nothing has moved"), "{name}: {said:?}");
        world.same_as_undisturbed(name);
    }
}

#[test]
fn a_suspension_during_set_up_ends_nothing() {
    let world = World::new("set-up", "damper");
    let out = world.path("run");
    let program = format!(
        "participants.damper.run={{ exe = '{}', args = ['4'] }}",
        participant("tardy").display()
    );
    let mut run = start(&[
        "run",
        text(&world.scenario),
        "--out",
        text(&out),
        "--set",
        &program,
        "--start-within",
        "3 s",
    ]);
    // The log exists before the participant is ready; a stop in between would leave all of its four seconds to the run.
    let log = out.join("log/damper.stderr");
    wait_until(&mut run, "the damper does not start", || writer_of(&log).is_some());
    signal(run.id(), Signal::STOP);
    std::thread::sleep(SUSPENSION + Duration::from_millis(500));
    signal(run.id(), Signal::CONT);
    let said = finish(run);
    assert_eq!(said.code, Some(0), "{said:?}");
    world.same_as_undisturbed("run");
}

#[test]
fn a_stopped_participant_is_named_whatever_it_was_doing() {
    let world = World::new("stopped", "damper");
    for (number, who) in ["plant", "damper", "damper", "plant"].into_iter().enumerate() {
        let name = format!("run{number}");
        let (run, [plant, damper]) = under_way(&world, &name, &[]);
        signal(if who == "plant" { plant } else { damper }, Signal::STOP);
        let said = finish(run);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(
            said.err.contains(&format!("participant `{who}`: nothing has moved")),
            "{said:?}"
        );
        assert!(said.err.contains("stopped by a signal or a debugger"), "{said:?}");
        world.prefix(&name);
    }
}

#[test]
fn a_substitution_after_a_failure_is_in_the_summary() {
    let world = World::new("summary", "damper");
    let (run, [_, damper]) = under_way(&world, "run", &["--set", &substitute(), "--json"]);
    signal(damper, Signal::STOP);
    let said = finish(run);
    assert_eq!(said.code, Some(0), "{said:?}");
    let recovered = said.json()["recovered"][0].to_string();
    assert!(
        recovered.contains("`damper`") && recovered.contains("takes over") && recovered.contains("nothing has moved"),
        "{recovered}"
    );
}
