//! A participant that is paused before its step: the inputs that it sees, and the outputs supplied instead of its step.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use engine::Catalogue;
use engine::run::{Options, Record, Run, RunFailure};
use engine::scenario::Scenario;
use escapement_tests::compiler::{NativeBuild, run_checked};
use escapement_tests::participants::{Damper, Motion, Oscillator, Push, in_process_options};
use escapement_tests::program::{Folder, participant};
use tape::EventKind;

/// An oscillator of 1 ms and a damper of 10 ms that sees it late and with noise, for 2 s.
fn scenario(processes: bool) -> Scenario {
    let catalogue = Catalogue::new("tests")
        .participant("oscillator", Oscillator::factory)
        .participant("damper", Damper::factory);
    let run = |name: &str| match processes {
        true => format!("{{ exe = \"{}\" }}", participant(name).display()),
        false => format!("{{ builtin = \"{name}\" }}"),
    };
    let text = format!(
        "duration = \"2 s\"\n[participants.plant]\nrun = {}\nperiod = \"1 ms\"\n[participants.damper]\nrun = {}\nperiod = \"10 ms\"\n\
         [connections.motion]\nfrom = \"plant.motion\"\nto = \"damper.motion\"\ndelay = \"3 ms\"\njitter = \"9 ms\"\n\
         [connections.push]\nfrom = \"damper.push\"\nto = \"plant.push\"\n\
         [[faults]]\nname = \"noise\"\nat = \"0.5 s\"\ninput = \"damper.motion\"\nfield = \"velocity\"\nkind = \"noise\"\nvalue = \"1 m/s\"\n",
        run("oscillator"),
        run("damper")
    );
    let read = Scenario::read_text(&Arc::new(catalogue), Path::new("code.toml"), &text);
    read.unwrap_or_else(|error| panic!("{error}"))
}

fn undisturbed_digest() -> String {
    let outcome = engine::run::run(&scenario(false), &in_process_options(Record::Digest)).unwrap();
    outcome.digest.unwrap().to_string()
}

fn digest(run: Run) -> String {
    run.end().unwrap().digest.unwrap().to_string()
}

/// The control law of the damper, computed by the test.
fn set_damper_output(run: &mut Run, count: &mut u64) {
    let motion: Motion = run.read_input("damper.motion").unwrap().get().unwrap();
    *count += 1;
    let (force, count) = (Damper::force(&motion), *count);
    run.set_output("damper.push", &Push { force, count }).unwrap();
}

#[test]
fn external_law_gives_the_tape_of_the_participant() {
    let whole = undisturbed_digest();
    let mut run = Run::start(&scenario(false), &in_process_options(Record::Memory)).unwrap();
    let mut count = 0;
    while run.run_to_step("damper").unwrap() {
        assert_eq!(run.now_s(), count as f64 / 100.0);
        set_damper_output(&mut run, &mut count);
    }
    assert!(run.is_over() && count == 200);
    assert_eq!(digest(run), whole);
}

#[test]
fn outputs_of_a_continuous_participant_are_set() {
    let whole = undisturbed_digest();
    let mut run = Run::start(&scenario(false), &in_process_options(Record::Memory)).unwrap();
    let mut motion = Motion {
        position: 1.0,
        velocity: 0.0,
    };
    while run.run_to_step("plant").unwrap() {
        let push: Push = run.read_input("plant.push").unwrap().get().unwrap();
        motion.velocity += 0.001 * (push.force - 4.0 * motion.position);
        motion.position += 0.001 * motion.velocity;
        run.set_output("plant.motion", &motion).unwrap();
    }
    assert_eq!(digest(run), whole);
}

#[test]
fn paused_participant_without_set_outputs_steps_normally() {
    let whole = undisturbed_digest();
    let mut run = Run::start(&scenario(false), &in_process_options(Record::Memory)).unwrap();
    // Paused repeatedly, with pauses in between, and restored.
    for name in ["damper", "damper", "plant", "plant", "damper"] {
        assert!(run.run_to_step(name).unwrap());
    }
    run.run_to("1/3 s").unwrap();
    let here = run.save().unwrap();
    assert!(run.run_to_step("damper").unwrap());
    assert_eq!(run.now().to_string(), "340 ms");
    run.step().unwrap();
    assert_eq!(run.now().to_string(), "341 ms");
    assert!(run.run_to_step("plant").unwrap());
    run.restore(&here).unwrap();
    assert!(run.run_to_step("damper").unwrap());
    run.run_to("2 s").unwrap();
    assert_eq!(digest(run), whole);
}

#[test]
fn tape_marks_outputs_set_from_outside() {
    let folder = Folder::new("step-pause");
    let out = folder.path().join("out");
    let options = Options {
        out: Some(out.clone()),
        ..in_process_options(Record::Folder)
    };
    let mut run = Run::start(&scenario(false), &options).unwrap();
    let mut count = 0;
    for _ in 0..3 {
        assert!(run.run_to_step("damper").unwrap());
        set_damper_output(&mut run, &mut count);
    }
    run.run_to("2 s").unwrap();
    run.end().unwrap();
    let events = std::fs::read_to_string(out.join("tape/events.jsonl")).unwrap();
    let events = events
        .lines()
        .map(|line| serde_json::from_str::<tape::Event>(line).unwrap());
    let given: Vec<_> = events.filter(|event| event.kind == EventKind::Note).collect();
    assert_eq!(given.len(), 1, "{given:?}");
    assert_eq!(given[0].participant.as_deref(), Some("damper"));
    assert!(given[0].text.contains("set by the program"), "{}", given[0].text);
}

#[test]
fn invalid_call_before_a_step_is_rejected() {
    let mut run = Run::start(&scenario(false), &in_process_options(Record::Memory)).unwrap();
    let has = |failure: RunFailure, words: &[&str]| {
        let message = failure.to_string();
        words
            .iter()
            .for_each(|word| assert!(message.contains(word), "no `{word}` in {message}"));
    };
    has(
        run.run_to_step("pilot").unwrap_err(),
        &["`pilot`", "no such participant", "`plant`"],
    );
    has(
        run.read_input("damper.motion").unwrap_err(),
        &["`damper` is not paused", "run_to_step(\"damper\")"],
    );
    has(
        run.set_output_bytes("damper.push", &[]).unwrap_err(),
        &["is not paused"],
    );
    assert!(run.run_to_step("damper").unwrap());
    has(
        run.save().unwrap_err(),
        &["`damper` is paused before its step", "run_to"],
    );
    has(run.run_to("0 s").unwrap_err(), &["is paused"]);
    has(
        run.read_input("damper.push").unwrap_err(),
        &["no such input; it has `motion`"],
    );
    has(run.read_input("plant.push").unwrap_err(), &["`plant` is not paused"]);
    has(
        run.set_output_bytes("damper.motion", &[]).unwrap_err(),
        &["no such output; it has `push`"],
    );
    has(
        run.set_output_bytes("damper.push", &[0; 3]).unwrap_err(),
        &["has 16 bytes, not 3"],
    );
    has(
        run.set_output("damper.push", &Motion::default()).unwrap_err(),
        &["no `Motion`"],
    );
    let nan = Push {
        force: f64::NAN,
        count: 0,
    };
    has(run.set_output("damper.push", &nan).unwrap_err(), &["finite", "force"]);
    run.run_to("1 s").unwrap();
    run.save().unwrap();
    let folder = Folder::new("step-pause-processes");
    let options = Options {
        out: Some(folder.path().join("out")),
        ..Options::default()
    };
    let mut run = Run::start(&scenario(true), &options).unwrap();
    has(
        run.run_to_step("damper").unwrap_err(),
        &["`damper`", "process of its own", "in_process"],
    );
    run.run_to("0.1 s").unwrap();
}

#[test]
fn program_in_c_takes_the_place_of_the_controller() {
    let native_build = NativeBuild::new("step-pause");
    let program = native_build.caller("tests/plugins/holder.c", "holder");
    let folder = Folder::new("step-pause-c");
    let scenario = folder.write(
        "springs.toml",
        "duration = \"1 s\"\n[participants.left]\nrun = { builtin = \"spring\" }\nperiod = \"1 ms\"\nparameters = { position = \"20 mm\", \
         mass = \"1 kg\", stiffness = \"40 N/m\", coupling = \"20 N/m\", damping = \"0 N s/m\" }\n[participants.right]\nrun = { builtin = \
         \"spring\" }\nperiod = \"2 ms\"\nparameters = { position = \"0 mm\", mass = \"1 kg\", stiffness = \"40 N/m\", coupling = \"20 N/m\", \
         damping = \"0 N s/m\" }\n[connections.there]\nfrom = \"left.motion\"\nto = \"right.neighbour\"\n[connections.back]\nfrom = \
         \"right.motion\"\nto = \"left.neighbour\"\n",
    );
    let output = run_checked(Command::new(program).arg(scenario));
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!(lines.len(), 3, "{output}");
    assert!(lines[0].contains("is not paused before a step"), "{output}");
    assert!(lines[1].len() >= 64, "{output}");
    assert_eq!(
        lines[1], lines[2],
        "by its own steps, and by the outputs that the program sets"
    );
}
