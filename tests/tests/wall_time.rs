//! The wall-clock time of a run: whether a pace is met and which participant is late, and a trace of every participant. The tape is
//! independent of it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use engine::Catalogue;
use engine::run::{Ending, Options, Outcome, Overrun, Record};
use engine::scenario::Scenario;
use escapement_tests::fixture::RunFixture;
use escapement_tests::participants::{Damper, Oscillator};
use escapement_tests::program::{Folder, root, run_orchestrator, text};
use lockstep::participant::{Failure, Inputs, Interface, Outputs, ParameterError, Participant, Setup, Step};
use serde_json::Value;

/// A damper whose step takes longer than the time available at the pace of these tests.
struct Slow(Box<dyn Participant>);

impl Slow {
    fn factory(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
        Ok(Box::new(Slow(Damper::factory(setup)?)))
    }
}

impl Participant for Slow {
    fn interface(&self) -> Interface {
        self.0.interface()
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.0.initialise(t, outputs)
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        std::thread::sleep(Duration::from_millis(3));
        self.0.step(step, inputs, outputs)
    }
}

/// A run in one loop of an oscillator and a damper that needs 3 ms for each of its ten steps.
fn run_in_one_loop(options: Options) -> Outcome {
    let catalogue = Catalogue::new("tests")
        .participant("oscillator", Oscillator::factory)
        .participant("slow", Slow::factory);
    let scenario = r#"
        duration = "0.1 s"
        participants.plant = { run = { builtin = "oscillator" }, period = "1 ms" }
        participants.damper = { run = { builtin = "slow" }, period = "10 ms" }
        connections.motion = { from = "plant.motion", to = "damper.motion" }
        connections.push = { from = "damper.push", to = "plant.push" }
    "#;
    let scenario = Scenario::read_text(&Arc::new(catalogue), Path::new("loop.toml"), scenario).unwrap();
    let options = Options {
        in_process: true,
        record: Record::Digest,
        ..options
    };
    engine::run::run(&scenario, &options).unwrap()
}

#[test]
fn missed_pace_is_reported_with_the_late_participant() {
    let fixture = RunFixture::new("late", "slow");
    // Ten times the wall clock's pace: the damper has 1 ms for a step that takes 3.
    let output = fixture.run("paced", &["--duration", "1 s", "--real-time=10", "--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("the pace was not met")
            && output
                .err
                .contains("late: `damper` (100 of 100 steps worked for longer"),
        "{output:?}"
    );
    let summary: Value = serde_json::from_str(&output.out).unwrap();
    let pace = &summary["pace"];
    assert_eq!(
        (&pace["met"], &pace["requested"]),
        (&Value::Bool(false), &Value::from(10.0)),
        "{pace}"
    );
    // A hundred steps of 3 ms each for one second: at most 3.4 times real time.
    let achieved = pace["achieved"].as_f64().unwrap();
    assert!(achieved > 0.0 && achieved < 3.4, "{pace}");
    for (name, steps) in [("plant", 1000), ("damper", 100)] {
        let own = &pace["participants"][name];
        assert_eq!(own["steps"], steps, "{pace}");
        let lateness =
            ["p50", "p99", "p999", "largest"].map(|part| own[format!("lateness_{part}_s")].as_f64().unwrap());
        assert!(lateness.is_sorted() && lateness[0] > 0.0, "{pace}");
    }
    assert_eq!(pace["participants"]["damper"]["too_long"], 100, "{pace}");
    assert!(
        pace["participants"]["damper"]["overruns"].as_u64() >= Some(99),
        "{pace}"
    );
    let kept = std::fs::read(fixture.path("paced/summary.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&kept).unwrap(), summary);
    // The tape is unchanged.
    assert_eq!(fixture.assert_prefix("paced"), 100);
}

#[test]
fn pace_in_one_loop_is_checked_as_in_processes() {
    let free = run_in_one_loop(Options::default());
    assert!(free.pace.is_none());
    let paced = run_in_one_loop(Options {
        pace: Some(10.0),
        ..Options::default()
    });
    assert_eq!((&paced.ending, paced.digest), (&Ending::Complete, free.digest));
    let pace = paced.pace.unwrap();
    let damper = &pace.participants["damper"];
    assert_eq!(
        (damper.steps, damper.too_long, pace.participants["plant"].steps),
        (10, 10, 100)
    );
    assert!(!pace.met && pace.achieved < Some(4.0), "{pace:?}");
    assert!(
        damper.lateness_p50_s >= 3e-3 && damper.lateness_largest_s >= 20e-3,
        "{pace:?}"
    );
    let warning = pace.warning().unwrap();
    assert!(warning.contains("`damper` (10 of 10 steps"), "{warning}");
}

#[test]
fn overrun_ends_a_run_with_overrun_stop() {
    let fixture = RunFixture::new("overrun", "slow");
    let output = fixture.run("stopped", &["--real-time=10", "--overrun", "stop", "--quiet"]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.err.contains("overrun at t = ") && output.err.contains("without --overrun stop"),
        "{output:?}"
    );
    assert!(fixture.assert_prefix("stopped") < 1000);
    let stopped = run_in_one_loop(Options {
        pace: Some(10.0),
        overrun: Overrun::Stop,
        ..Options::default()
    });
    assert!(
        matches!(&stopped.ending, Ending::Stopped { reason } if reason.contains("overrun at t = ")),
        "{:?}",
        stopped.ending
    );
    let output = fixture.run("refused", &["--overrun", "stop"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("--real-time"), "{output:?}");
}

/// The spans of a trace by participant, in the order of their start, and its other events.
fn read_trace(file: &Path) -> (BTreeMap<String, Vec<Value>>, Vec<Value>) {
    let trace: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let (mut names, mut spans, mut marks) = (BTreeMap::new(), BTreeMap::<String, Vec<Value>>::new(), Vec::new());
    for event in trace["traceEvents"].as_array().unwrap() {
        match event["ph"].as_str().unwrap() {
            "M" if event["name"] == "process_name" => {
                names.insert(
                    event["pid"].as_u64(),
                    event["args"]["name"].as_str().unwrap().to_owned(),
                );
            }
            "M" => assert_eq!(event["name"], "thread_name"),
            "X" => spans
                .entry(names[&event["pid"].as_u64()].clone())
                .or_default()
                .push(event.clone()),
            _ => marks.push(event.clone()),
        }
    }
    for own in spans.values_mut() {
        own.sort_by(|a, b| a["ts"].as_f64().unwrap().total_cmp(&b["ts"].as_f64().unwrap()));
        for pair in own.windows(2) {
            let end = pair[0]["ts"].as_f64().unwrap() + pair[0]["dur"].as_f64().unwrap();
            assert!(pair[1]["ts"].as_f64().unwrap() >= end - 2e-3, "spans overlap: {pair:?}");
        }
    }
    (spans, marks)
}

/// Every activation of a participant is one complete step, in order.
fn assert_all_steps(spans: &[Value], activations: u64) {
    let steps = spans
        .iter()
        .filter(|span| span["cat"] == "step" && span["args"]["complete"] == true);
    let steps: Vec<u64> = steps.map(|span| span["args"]["activation"].as_u64().unwrap()).collect();
    assert_eq!(steps, (0..activations).collect::<Vec<_>>());
}

#[test]
fn trace_has_every_step_and_its_wait_reasons() {
    let fixture = RunFixture::new("traced", "damper");
    let file = fixture.path("trace.json");
    let output = fixture.run("run", &["--trace", text(&file), "--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    fixture.assert_same_as_undisturbed("run");
    let (spans, marks) = read_trace(&file);
    let summary: Value = serde_json::from_str(&output.out).unwrap();
    assert_eq!(
        (marks.len(), &summary["trace"]["missing"]),
        (0, &Value::from(0)),
        "{marks:?}"
    );
    assert_eq!(summary["trace"]["spans"], spans.values().map(Vec::len).sum::<usize>());
    assert_all_steps(&spans["plant"], 10_000);
    assert_all_steps(&spans["damper"], 1000);
    let waits = |participant_name: &str, name: &str| {
        let own = spans[participant_name].iter().filter(|span| span["name"] == name);
        own.cloned().collect::<Vec<_>>()
    };
    // Sampled and without a delay: the plant cannot step before the damper has answered.
    let waited = waits("plant", "waits for `push`");
    assert!(!waited.is_empty());
    assert!(
        waited.iter().all(|span| span["args"]["output"] == "damper.push"),
        "{:?}",
        waited[0]
    );
    assert!(
        waits("damper", "waits for `motion`")
            .iter()
            .all(|span| span["args"]["output"] == "plant.motion")
    );
    // The step that was waited for starts at the end of the wait.
    let own = &spans["plant"];
    let at = own.iter().position(|span| span == &waited[0]).unwrap();
    assert_eq!(own[at + 1]["args"]["activation"], waited[0]["args"]["activation"]);
    assert_eq!(own[at + 1]["cat"], "step");
}

#[test]
fn trace_of_one_loop_has_the_steps_of_all_participants() {
    let folder = Folder::new("trace");
    let file = folder.path().join("loop.json");
    let out = folder.path().join("run");
    let close = root().join("scenarios/close.toml");
    let common = ["--in-process", "--duration", "1 s", "--quiet"];
    let named = ["run", text(&close), "--out", text(&out), "--trace", text(&file)];
    let output = run_orchestrator(&[&named[..], &common].concat());
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    let (spans, marks) = read_trace(&file);
    assert!(marks.is_empty(), "{marks:?}");
    for (participant_name, activations) in [("plant", 1000), ("controller", 100), ("guidance", 100)] {
        assert_all_steps(&spans[participant_name], activations);
    }
}

#[test]
fn requested_files_in_a_run_folder_are_replaced_with_the_run() {
    let fixture = RunFixture::new("within", "damper");
    let out = fixture.path("run");
    let within = |name: &str| out.join(name);
    let trace = within("trace.json");
    for _ in 0..2 {
        let output = fixture.run("run", &["--duration", "1 s", "--force", "--trace", text(&trace)]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let (page, figures, csv) = (within("mine.html"), within("figures"), within("csv"));
        for arguments in [
            &["report", text(&out), "--out", text(&page), "--figures", text(&figures)][..],
            &["export", text(&out), "--to", "csv", "--out", text(&csv)],
        ] {
            let output = run_orchestrator(arguments);
            assert_eq!(output.code, Some(0), "{output:?}");
        }
    }
    std::fs::write(within("csv/notes.txt"), "work of years").unwrap();
    let output = fixture.run("run", &["--duration", "1 s", "--force"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("`csv/notes.txt` in it does not belong"),
        "{output:?}"
    );
    assert!(within("csv/notes.txt").exists() && trace.exists());
}

#[test]
fn trace_that_cannot_be_written_is_refused() {
    let fixture = RunFixture::new("untraceable", "damper");
    let output = fixture.run("run", &["--trace", "/no/such/folder/trace.json"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output
            .err
            .contains("--trace /no/such/folder/trace.json: cannot be written"),
        "{output:?}"
    );
    assert!(!fixture.path("run").exists());
}

#[test]
fn incomplete_trace_is_marked_as_incomplete() {
    let fixture = RunFixture::new("full", "damper");
    let output = fixture.run("run", &["--trace", "/dev/full"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let expected = "trace: /dev/full is incomplete: No space left on device";
    assert!(output.out.contains(expected), "{output:?}");
}
