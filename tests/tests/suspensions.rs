//! Runs that are stopped and continued: time in which the orchestrator did not run is not counted against any participant.

use std::process::Child;
use std::time::Duration;

use escapement_tests::fixture::RunFixture;
use escapement_tests::machine::{send_signal, wait_for_bytes, wait_until, writer_of};
use escapement_tests::program::{participant, start_orchestrator, text, wait_for_output};
use rustix::process::Signal;

/// Longer than the patience of these runs.
const SUSPENSION: Duration = Duration::from_secs(3);

/// A paced run after a tenth of its duration, and the processes of its plant and its damper.
fn start_paced_run(fixture: &RunFixture, name: &str, more: &[&str]) -> (Child, [u32; 2]) {
    let out = fixture.path(name);
    let mut arguments = vec![
        "run",
        text(&fixture.scenario),
        "--out",
        text(&out),
        "--real-time=5",
        "--patience",
        "1 s",
    ];
    arguments.extend(more);
    let mut run = start_orchestrator(&arguments);
    wait_for_bytes(&mut run, &out.join("tape/damper.push.bin"), 24 * 100);
    let pid = |participant_name: &str| {
        writer_of(&out.join("log").join(format!("{participant_name}.stderr"))).expect("the participant runs")
    };
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
fn suspension_beyond_patience_does_not_change_the_tape() {
    let fixture = RunFixture::new("suspended", "damper");
    let policy = substitute();
    // The orchestrator alone, as by Ctrl-Z, and all processes, as by a paused container.
    let alone = ["alone", "alone with a policy"];
    let all = ["all", "all with a policy"];
    let policies = [&[][..], &["--set", &policy]];
    let mut runs = Vec::new();
    for (names, everything) in [(alone, false), (all, true)] {
        for (name, more) in names.into_iter().zip(policies) {
            let (run, participants) = start_paced_run(&fixture, name, more);
            send_signal(run.id(), Signal::STOP);
            let others = if everything { participants.to_vec() } else { Vec::new() };
            others.iter().for_each(|&pid| assert!(send_signal(pid, Signal::STOP)));
            runs.push((name, run, others));
        }
    }
    std::thread::sleep(SUSPENSION);
    for (_, run, others) in &runs {
        others.iter().for_each(|&pid| assert!(send_signal(pid, Signal::CONT)));
        send_signal(run.id(), Signal::CONT);
    }
    for (name, run, _) in runs {
        let output = wait_for_output(run);
        assert_eq!(output.code, Some(0), "{name}: {output:?}");
        assert!(!output.err.contains("nothing has moved"), "{name}: {output:?}");
        fixture.assert_same_as_undisturbed(name);
    }
}

#[test]
fn suspension_during_set_up_does_not_end_the_run() {
    let fixture = RunFixture::new("set-up", "damper");
    let out = fixture.path("run");
    let program = format!(
        "participants.damper.run={{ exe = '{}', args = ['4'] }}",
        participant("slow_start").display()
    );
    let mut run = start_orchestrator(&[
        "run",
        text(&fixture.scenario),
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
    send_signal(run.id(), Signal::STOP);
    std::thread::sleep(SUSPENSION + Duration::from_millis(500));
    send_signal(run.id(), Signal::CONT);
    let output = wait_for_output(run);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
}

#[test]
fn stopped_participant_is_named_in_every_state() {
    let fixture = RunFixture::new("stopped", "damper");
    for (number, participant_name) in ["plant", "damper", "damper", "plant"].into_iter().enumerate() {
        let name = format!("run{number}");
        let (run, [plant, damper]) = start_paced_run(&fixture, &name, &[]);
        send_signal(if participant_name == "plant" { plant } else { damper }, Signal::STOP);
        let output = wait_for_output(run);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(
            output
                .err
                .contains(&format!("participant `{participant_name}`: nothing has moved")),
            "{output:?}"
        );
        assert!(output.err.contains("stopped by a signal or a debugger"), "{output:?}");
        fixture.assert_prefix(&name);
    }
}

#[test]
fn substitution_after_a_failure_is_in_the_summary() {
    let fixture = RunFixture::new("summary", "damper");
    let (run, [_, damper]) = start_paced_run(&fixture, "run", &["--set", &substitute(), "--json"]);
    send_signal(damper, Signal::STOP);
    let output = wait_for_output(run);
    assert_eq!(output.code, Some(0), "{output:?}");
    let recovered = output.json()["recovered"][0].to_string();
    assert!(
        recovered.contains("`damper`") && recovered.contains("takes over") && recovered.contains("nothing has moved"),
        "{recovered}"
    );
}
