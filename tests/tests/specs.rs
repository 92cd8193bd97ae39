//! Scenarios as values: a scenario built in code equals the one of a file, any scenario can be written and read again, and mistakes in
//! both are reported alike.

use std::path::Path;
use std::sync::Arc;

use engine::Catalogue;
use engine::run::{self, Ending, Options, Record};
use engine::scenario::{
    ConnectionSpec, FaultKind, FaultSpec, GuardSpec, MeasureKind, MeasureSpec, OnFailureSpec, ParticipantSpec,
    RecordSpec, RunSpec, Scenario, ScenarioError, ScenarioSpec, State, Time,
};
use escapement_tests::participants::{Damper, Oscillator};
use escapement_tests::program::{Folder, participant};
use lockstep::link::Hold;
use toml::{Table, Value};

fn catalogue() -> Arc<Catalogue> {
    let catalogue = Catalogue::new("tests")
        .participant("oscillator", Oscillator::factory)
        .participant("damper", Damper::factory);
    Arc::new(catalogue)
}

/// The scenario as a file.
const TEXT: &str = r#"
    title = "An oscillator and its damper"
    duration = "2 s"
    seed = 7
    [participants.plant]
    run = { builtin = "oscillator" }
    period = "1 kHz"
    [participants.damper]
    run = { builtin = "damper" }
    period = "10 ms"
    offset = "0.005 s"
    on-failure = "restart-from-checkpoint"
    [connections.motion]
    from = "plant.motion"
    to = "damper.motion"
    delay = "3 ms"
    jitter = "2 ms"
    drop = 0.1
    hold = "linear"
    initial = { position = 1.0 }
    [connections.push]
    from = "damper.push"
    to = ["plant.push"]
    map = { force = { from = "force", factor = 0.5 }, count = "count" }
    [[faults]]
    at = "0.5 s"
    until = "700 ms"
    output = "plant.motion"
    field = "velocity"
    kind = "noise"
    value = "0.1 m/s"
    [[faults]]
    name = "late"
    at = "1 s"
    connection = "push"
    extra-delay = "20 ms"
    [[faults]]
    at = "1.5 s"
    substitute = "damper"
    run = { builtin = "damper" }
    state = "keep"
    [guards.wide]
    output = "plant.motion"
    field = "position"
    range = "[-100, 100] m"
    [measures.largest]
    of = "plant.motion.position"
    compute = "max-abs"
    from = "100 ms"
    at-most = "50 m"
    [record.damper]
    push = { every = "20 ms" }
"#;

/// The same in code.
fn build_spec(run: impl Fn(&str) -> RunSpec) -> ScenarioSpec {
    let motion = ConnectionSpec::new("plant.motion", "damper.motion")
        .delay("3 ms")
        .jitter("2 ms")
        .dropping(0.1)
        .hold(Hold::Linear)
        .initial(Table::from_iter([("position".to_owned(), Value::Float(1.0))]));
    let damper = ParticipantSpec::new(run("damper"))
        .every("100 Hz")
        .offset("5 ms")
        .on_failure(OnFailureSpec::RestartFromCheckpoint);
    let noise = FaultSpec::output("plant.motion", "500 ms", FaultKind::Noise)
        .until("0.7 s")
        .field("velocity")
        .value("0.1 m/s");
    let half = [
        ("from".to_owned(), Value::from("force")),
        ("factor".to_owned(), Value::Float(0.5)),
    ];
    let push = ConnectionSpec::new("damper.push", "plant.push")
        .field("force", Table::from_iter(half))
        .field("count", "count");
    ScenarioSpec::new("2 s")
        .title("An oscillator and its damper")
        .seed(7)
        .participant("plant", ParticipantSpec::new(run("oscillator")).every("1 ms"))
        .participant("damper", damper)
        .connection("motion", motion)
        .connection("push", push)
        .fault(noise)
        .fault(FaultSpec::connection("push", "1 s").named("late").extra_delay("20 ms"))
        .fault(FaultSpec::substitute("damper", "1500 ms", run("damper")).state(State::Keep))
        .guard(
            "wide",
            GuardSpec::new("plant.motion").field("position").range("[-100, 100] m"),
        )
        .measure(
            "largest",
            MeasureSpec::new("plant.motion.position", MeasureKind::MaxAbs)
                .from("100 ms")
                .at_most("50 m"),
        )
        .record("damper.push", RecordSpec::every("20 ms"))
}

/// The digest and the plan of a run in `out`.
fn recorded(scenario: &Scenario, out: &Path, in_process: bool) -> (String, String) {
    let options = Options {
        in_process,
        out: Some(out.to_owned()),
        ..Options::default()
    };
    let outcome = run::run(scenario, &options).unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(outcome.ending, Ending::Complete);
    let plan = std::fs::read_to_string(out.join("plan.toml")).unwrap();
    (outcome.digest.expect("a digest").to_string(), plan)
}

/// A replacement program needs all samples.
fn record_everything(spec: &mut ScenarioSpec) {
    spec.record.clear();
    spec.participants["damper"].on_failure = OnFailureSpec::Stop;
}

#[test]
fn scenario_built_in_code_equals_the_one_read_from_a_file() {
    let (folder, catalogue) = (Folder::new("specs"), catalogue());
    let file = folder.path().join("loop.toml");
    let (mut read, mut own) = (
        ScenarioSpec::of_text(&file, TEXT).unwrap(),
        build_spec(RunSpec::builtin),
    );
    assert_eq!(read, own);
    record_everything(&mut read);
    record_everything(&mut own);
    let run = |spec: &ScenarioSpec, out: &str, in_process: bool| {
        let scenario = Scenario::of(&catalogue, spec.clone(), &file).unwrap_or_else(|error| panic!("{error}"));
        recorded(&scenario, &folder.path().join(out), in_process)
    };
    let of_file = run(&read, "file", true);
    assert_eq!(run(&own, "code", true), of_file, "tape and plan");
    // The plan is an equivalent scenario too.
    let again = Scenario::read(&catalogue, &folder.path().join("code/plan.toml"), &[]).unwrap();
    assert_eq!(recorded(&again, &folder.path().join("again"), true), of_file);
    // In processes, whose programs are files.
    let mut files = build_spec(|name| RunSpec::exe::<String>(participant(name).to_str().unwrap(), []));
    record_everything(&mut files);
    assert_eq!(run(&files, "apart", false).0, of_file.0);
}

#[test]
fn loaded_scenario_is_changed_by_its_fields_and_by_keys() {
    let (catalogue, file) = (catalogue(), Path::new("loop.toml"));
    let mut fields = ScenarioSpec::of_text(file, TEXT).unwrap();
    let mut keys = fields.clone();
    fields.participants["damper"].period = "20 ms".into();
    fields.connections["motion"].delay = "7 ms".into();
    fields.faults.remove(0);
    fields.seed = u64::MAX;
    fields.measures["largest"].at_most = Some("1 m".into());
    keys.set("participants.damper.period", "20 ms").unwrap();
    keys.set("connections.motion.delay", "7 ms").unwrap();
    keys.set("seed", u64::MAX.to_string()).unwrap();
    let last_two = Value::try_from(&fields.faults).unwrap();
    keys.set("faults", last_two).unwrap();
    keys.set("measures.largest.at-most", "1 m").unwrap();
    assert_eq!(fields, keys);
    let texts = [
        "participants.damper.period=20ms",
        "connections.motion.delay=7ms",
        "seed=18446744073709551615",
        "measures.largest.at-most=1 m",
    ];
    let mut options = ScenarioSpec::read_changed(TEXT, &texts);
    options.faults.remove(0);
    assert_eq!(options, fields);
    let digest = |spec: &ScenarioSpec| {
        let mut spec = spec.clone();
        record_everything(&mut spec);
        let scenario = Scenario::of(&catalogue, spec, file).unwrap();
        let options = Options {
            in_process: true,
            record: Record::Digest,
            ..Options::default()
        };
        run::run(&scenario, &options).unwrap().digest.unwrap().to_string()
    };
    assert_eq!(digest(&fields), digest(&options));
    assert_ne!(digest(&fields), digest(&build_spec(RunSpec::builtin)));
}

trait ReadChanged {
    fn read_changed(text: &str, changes: &[&str]) -> ScenarioSpec;
}

impl ReadChanged for ScenarioSpec {
    fn read_changed(text: &str, changes: &[&str]) -> ScenarioSpec {
        let mut spec = ScenarioSpec::of_text(Path::new("loop.toml"), text).unwrap();
        let changes: Vec<String> = changes.iter().map(|one| (*one).to_owned()).collect();
        spec.change(&changes).unwrap();
        spec
    }
}

/// The messages about `spec` as the scenario in `loop.toml`.
fn check_error(spec: ScenarioSpec) -> ScenarioError {
    let refused = Scenario::of(&catalogue(), spec, Path::new("loop.toml"));
    refused.err().expect("it is wrong")
}

#[test]
fn errors_in_code_name_the_key_the_value_and_the_remedy() {
    type Change = fn(&mut ScenarioSpec);
    let cases: [(Change, &str); 14] = [
        (
            |spec| spec.duration = "soon".into(),
            "loop.toml: duration: `soon` is not a time: write a number and a unit",
        ),
        (
            |spec| spec.title = "One\nTwo".into(),
            "loop.toml: title: \"One\\nTwo\" has the control character '\\n': write one line without control characters",
        ),
        (
            |spec| spec.participants["damper"].period = Time::default(),
            "loop.toml: participants.damper.period: the period is 0 s; it must be positive",
        ),
        (
            |spec| spec.participants["plant"].run = RunSpec::builtin("oscilator"),
            "loop.toml: participants.plant.run: there is no builtin `oscilator`; there is `damper`, `oscillator`",
        ),
        (
            |spec| spec.participants["plant"].run = RunSpec::default(),
            "loop.toml: participants.plant.run: write { builtin = \"NAME\" }",
        ),
        (
            |spec| spec.connections["push"].delay = "3 m".into(),
            "loop.toml: connections.push.delay: `3 m` has the unit `m`, which is not one of time",
        ),
        (
            |spec| spec.faults[0].at = "-1 s".into(),
            "loop.toml: faults.fault-1.at: -1 s is before the start",
        ),
        (
            |spec| spec.faults[1].input = Some("plant.push".into()),
            "loop.toml: faults.late.connection: a fault has exactly one of `input`, `output`, `connection` and `substitute`",
        ),
        (
            |spec| spec.faults[0].extra_delay = Some("1 ms".into()),
            "loop.toml: faults.fault-1.extra-delay: does not belong to a fault with `output`",
        ),
        (
            |spec| spec.guards["wide"].output = "plan.motion".into(),
            "loop.toml: guards.wide.output: there is no participant `plan`; there is `damper`, `plant`",
        ),
        (
            |spec| spec.measures["largest"].at = Some("1 s".into()),
            "loop.toml: measures.largest.at: does not belong to compute = \"max-abs\"",
        ),
        (
            |spec| {
                spec.record.insert("damper".into(), RecordSpec::Nothing);
            },
            "loop.toml: record.damper.push: says what is recorded of one stream, and `damper` of all of them",
        ),
        (
            |spec| {
                spec.record.insert("plant".into(), RecordSpec::every("1 s"));
            },
            "loop.toml: record.plant: a part is one of a stream: name it, such as `plant.OUTPUT`, or keep all or nothing",
        ),
        (
            |spec| spec.inputs.push("plant".into()),
            "loop.toml: inputs: `plant` is not a port: write \"PARTICIPANT.PORT\"",
        ),
    ];
    for (change, output) in cases {
        let mut spec = build_spec(RunSpec::builtin);
        change(&mut spec);
        let error = check_error(spec).to_string();
        assert!(error.starts_with(output), "{error}\ninstead of\n{output}");
    }
    // All of them at once.
    let mut spec = build_spec(RunSpec::builtin);
    spec.participants["plant"].run = RunSpec::builtin("none");
    spec.guards["wide"].field = None;
    assert_eq!(check_error(spec).mistakes.len(), 2);
}

#[test]
fn errors_in_a_read_scenario_name_the_line_or_the_override() {
    let mut spec = ScenarioSpec::of_text(Path::new("elsewhere.toml"), TEXT).unwrap();
    spec.participants["damper"].period = "-1 s".into();
    let line = TEXT
        .lines()
        .position(|line| line.contains("period = \"10 ms\""))
        .unwrap()
        + 1;
    let error = check_error(spec.clone()).to_string();
    let expected = format!("loop.toml:{line}: participants.damper.period: the period is -1 s; it must be positive");
    assert_eq!(error, expected);
    spec.participants["damper"].period = "1 s".into();
    spec.set("connections.motion.from", "plant").unwrap();
    let scenario = Scenario::of(&catalogue(), spec.clone(), Path::new("loop.toml")).unwrap();
    let error = run::check(&scenario)
        .err()
        .expect("there is no such output")
        .to_string();
    let expected =
        "loop.toml: connections.motion.from: `plant` is not a port: write \"PARTICIPANT.PORT\" (set in code)";
    assert!(error.contains(expected), "{error}");
    for (key, value, output) in [
        (
            "connections.notion.to",
            "damper.motion",
            "there is no `notion` in `connections` (set in code); there is `motion`, `push`",
        ),
        ("participants.damper.perod", "1 s", "unknown field `perod`"),
        (
            "faults.early.at",
            "1 s",
            "the list has no entry `early` with keys (set in code)",
        ),
        ("duration", "now", "`now` is not a time"),
    ] {
        let before = spec.clone();
        let error = spec.set(key, value).expect_err("it is refused").to_string();
        assert!(error.contains(output), "{error}");
        assert_eq!(spec, before, "a change that is refused changes nothing");
    }
}

#[test]
fn files_that_a_scenario_names_in_code_are_read() {
    let folder = Folder::new("spec-files");
    std::fs::write(folder.path().join("own.toml"), "stiffness = 3.5\n").unwrap();
    std::fs::write(folder.path().join("note.txt"), "text").unwrap();
    let spec = |file: &str| {
        let mut spec = ScenarioSpec::new("1 s").input("plant.push").participant(
            "plant",
            ParticipantSpec::builtin("oscillator")
                .every("1 ms")
                .parameter("own", Table::from_iter([("file".to_owned(), Value::from(file))])),
        );
        spec.title = "With a file".into();
        spec
    };
    let of = |spec: ScenarioSpec| Scenario::of(&catalogue(), spec, &folder.path().join("files.toml"));
    let scenario = of(spec("own.toml")).unwrap();
    let own = &scenario.spec().participants["plant"].parameters["own"];
    assert_eq!(own["stiffness"].as_float(), Some(3.5));
    assert_eq!(scenario.files(), [folder.path().join("own.toml")]);
    let error = of(spec("none.toml")).err().unwrap().to_string();
    assert!(
        error.contains("participants.plant.parameters.own: the file `") && error.contains("cannot be read"),
        "{error}"
    );
    let mut text = spec("own.toml");
    text.participants["plant"].parameters = Table::from_iter([("file".to_owned(), Value::from("note.txt"))]);
    let error = of(text).err().unwrap().to_string();
    assert!(
        error.contains("participants.plant.parameters: the file has text where keys are needed"),
        "{error}"
    );
}
