//! Unseen samples are not computed, and the seen samples do not depend on that.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use engine::Catalogue;
use engine::run::{Ending, Options, Outcome, Record, Run};
use engine::scenario::Scenario;
use escapement_tests::participants::{Damper, Motion, Push, in_process_options};
use escapement_tests::program::{Folder, root, run_orchestrator, text};
use lockstep::participant::{
    Failure, InputPort, Inputs, Interface, Kind, OutputPort, Outputs, Participant, Ports, Step,
};
use tape::{Reader, Records, Source};

/// An oscillator that counts how often it computes each of its outputs, and writes wrong values for unseen ones.
struct Counting {
    ports: Ports,
    push: InputPort<Push>,
    motion: OutputPort<Motion>,
    detail: OutputPort<Motion>,
    now: Motion,
    counts: Arc<[AtomicU64; 2]>,
}

impl Counting {
    fn new(counts: Arc<[AtomicU64; 2]>) -> Counting {
        let mut ports = Ports::new(Kind::Continuous);
        Counting {
            push: ports.input("push"),
            motion: ports.output("motion"),
            detail: ports.output("detail"),
            ports,
            now: Motion {
                position: 1.0,
                velocity: 0.0,
            },
            counts,
        }
    }

    fn write(&self, outputs: &mut Outputs) {
        for (port, count) in [self.motion, self.detail].into_iter().zip(self.counts.iter()) {
            let spoilt = Motion {
                position: f64::NAN,
                velocity: f64::NAN,
            };
            let seen = outputs.is_seen(port.number());
            assert!(!seen || outputs.is_ever_seen(port.number()));
            outputs[port] = if seen { self.now } else { spoilt };
            count.fetch_add(u64::from(seen), Ordering::Relaxed);
        }
    }
}

impl Participant for Counting {
    fn interface(&self) -> Interface {
        self.ports.interface()
    }

    fn initialise(&mut self, _: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        self.write(outputs);
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        self.now.velocity += step.period * (inputs[self.push].force - 4.0 * self.now.position);
        self.now.position += step.period * self.now.velocity;
        self.write(outputs);
        Ok(())
    }
}

/// Two seconds of the oscillator with its damper; and how often it has computed `motion` and `detail`.
fn scenario(more: &str) -> (Scenario, Arc<[AtomicU64; 2]>) {
    let counts: Arc<[AtomicU64; 2]> = Arc::default();
    let own = counts.clone();
    let catalogue = Catalogue::new("tests")
        .participant("counting", move |_| Ok(Box::new(Counting::new(own.clone()))))
        .participant("damper", Damper::factory);
    let text = r#"
duration = "2 s"
[participants.plant]
run = { builtin = "counting" }
period = "1 ms"
[participants.damper]
run = { builtin = "damper" }
period = "10 ms"
[connections.motion]
from = "plant.motion"
to = "damper.motion"
delay = "3 ms"
[connections.push]
from = "damper.push"
to = "plant.push"
"#;
    let read = Scenario::read_text(&Arc::new(catalogue), Path::new("seen.toml"), &(text.to_owned() + more));
    (read.unwrap_or_else(|error| panic!("{error}")), counts)
}

/// A run to its end; and how often `motion` and `detail` were computed in it.
fn run(more: &str, options: &Options) -> (Outcome, [u64; 2]) {
    let (scenario, counts) = scenario(more);
    let outcome = engine::run::run(&scenario, options).unwrap();
    assert_eq!(outcome.ending, Ending::Complete);
    (outcome, counts.each_ref().map(|count| count.load(Ordering::Relaxed)))
}

const MEASURE: &str = "[measures.swing]\nof = \"plant.detail.position\"\ncompute = \"rms\"\n";
const GUARD: &str = "[guards.detail]\noutput = \"plant.detail\"\nfield = \"position\"\nrange = \"[-9, 9] m\"\n";

/// 2000 steps and the sample before them.
const ALL: u64 = 2001;
/// The samples that the damper reads: the one at 7 ms and every tenth one from there on.
const READ: u64 = 199;

#[test]
fn outputs_are_computed_where_they_are_seen() {
    let folder = Folder::new("seen");
    let record = |detail: &str| format!("[record]\nplant = {{ motion = false, detail = {detail} }}\ndamper = false\n");
    // A fault may hold the first value in its span, and a substitute the last one of the previous program.
    let fault = "[[faults]]\noutput = \"plant.motion\"\nkind = \"stuck\"\nat = \"1 s\"\n";
    let substitute = "[[faults]]\nsubstitute = \"plant\"\nat = \"1 s\"\nrun = { builtin = \"counting\" }\n";
    for (more, kept, computed) in [
        ("", Record::Nothing, [READ, 0]),
        ("", Record::Digest, [ALL, ALL]),
        ("", Record::Memory, [ALL, ALL]),
        (MEASURE, Record::Nothing, [READ, ALL]),
        (GUARD, Record::Nothing, [READ, ALL]),
        (fault, Record::Nothing, [ALL, 0]),
        // One more for the program that starts.
        (substitute, Record::Nothing, [ALL + 1, ALL + 1]),
        (&record("false"), Record::Digest, [READ, 0]),
        (
            &record("{ every = \"50 ms\", from = \"0.1 s\" }"),
            Record::Memory,
            [READ, 39],
        ),
        (
            &record("{ every = \"50 ms\", from = \"0.1 s\" }"),
            Record::Nothing,
            [READ, 0],
        ),
    ] {
        let (outcome, counts) = run(more, &in_process_options(kept));
        assert_eq!(counts, computed, "{more} {kept:?}");
        assert_eq!(outcome.digest.is_some(), kept != Record::Nothing);
    }
    // The tape of a folder has what the scenario states, and a program that requests it may get everything.
    let options = Options {
        record: Record::Folder,
        out: Some(folder.path().join("run")),
        ..in_process_options(Record::Folder)
    };
    assert_eq!(run(&record("{ to = \"9 ms\" }"), &options).1, [READ, 10]);
    let (scenario, counts) = scenario("");
    let mut run = Run::start(&scenario, &in_process_options(Record::Nothing)).unwrap();
    assert!(run.newest("plant.detail").unwrap().get::<Motion>().unwrap().position > 0.9);
    run.run_to("2 s").unwrap();
    assert_eq!(run.end().unwrap().ending, Ending::Complete);
    assert_eq!(counts[1].load(Ordering::Relaxed), ALL);
}

#[test]
fn figures_do_not_depend_on_what_else_is_seen() {
    let figures = |record| run(MEASURE, &in_process_options(record)).0.figures.unwrap().measures;
    assert_eq!(figures(Record::Nothing), figures(Record::Memory));
}

/// A stock scenario without its assessment, which reads the true state.
fn write_unassessed(folder: &Folder, name: &str) -> PathBuf {
    for shared in ["models", "gains"] {
        let link = folder.path().join(shared);
        if !link.exists() {
            std::os::unix::fs::symlink(root().join(shared), link).unwrap();
        }
    }
    let scenario = std::fs::read_to_string(root().join("scenarios").join(name)).unwrap();
    let mut scenario: toml::Table = scenario.parse().unwrap();
    for judge in ["assessment", "measures", "report", "guards"] {
        scenario.remove(judge);
    }
    std::fs::create_dir_all(folder.path().join("scenarios")).unwrap();
    folder.write(&format!("scenarios/{name}"), &scenario.to_string())
}

/// The samples of each stream by their stamps.
fn samples(run: &Path) -> BTreeMap<String, BTreeMap<u64, Vec<u8>>> {
    let tape = Reader::open(run).expect("there is a tape");
    let streams = tape.streams().iter().enumerate().map(|(stream, spec)| {
        let (mut records, mut samples) = (Records::new(&tape, stream), BTreeMap::new());
        while let Some(record) = records.next().expect("it can be read") {
            samples.insert(record.stamp_s.to_bits(), record.payload.to_vec());
        }
        (spec.name(), samples)
    });
    streams.collect()
}

#[test]
fn stock_plant_gives_the_same_bits_whatever_is_seen() {
    let folder = Folder::new("seen-plant");
    // Noise, drift and readings that are held; a target that is gripped; propellant on a ball joint; a sensor that fails.
    let spherical = ["--set", "participants.plant.parameters.slosh=\"spherical\""];
    let stuck = ["--fault", "output=plant.camera,kind=stuck,at=1.5s,field=p_NT_N"];
    let gripped = [
        "--set",
        "participants.plant.parameters.after_grasp={ at = \"0.5 s\", within = \"9 m\", within_angle = \"180 deg\" }",
    ];
    for (name, more) in [
        ("realistic.toml", &[][..]),
        ("close.toml", &spherical),
        ("realistic.toml", &stuck),
        ("capture-and-stabilise.toml", &gripped),
    ] {
        let scenario = write_unassessed(&folder, name);
        let run = |out: &str, how: &[&str]| {
            let out = folder.path().join(out);
            let mut arguments = vec![
                "run",
                text(&scenario),
                "--duration",
                "2 s",
                "--quiet",
                "--force",
                "--out",
                text(&out),
            ];
            arguments.extend(more);
            let output = run_orchestrator(&[&arguments, how].concat());
            assert_eq!(output.code, Some(0), "{output:?}");
            samples(&out)
        };
        let whole = run("whole", &["--in-process"]);
        for parts in [
            "{ truth = { every = \"70 ms\", from = \"0.3 s\" }, measured = false, target = false, camera = false, housekeeping = false }",
            "{ truth = false, measured = { every = \"3 ms\" }, camera = { every = \"130 ms\" }, housekeeping = { every = \"11 ms\" }, target = { from = \"1 s\" } }",
        ] {
            let record = format!("record.plant={parts}");
            let part = run("part", &["--in-process", "--set", &record]);
            let apart = run("apart", &["--set", &record]);
            assert_eq!(part, apart, "in processes");
            for (stream, kept) in &part {
                assert!(!kept.is_empty(), "{stream}");
                for (stamp, payload) in kept {
                    let t = f64::from_bits(*stamp);
                    assert_eq!(whole[stream][stamp], *payload, "{name}: {stream} at {t} s with {parts}");
                }
            }
            assert_eq!(part["controller.command"], whole["controller.command"]);
        }
    }
}

#[test]
fn campaign_has_whole_tape_digests_on_request() {
    let folder = Folder::new("seen-campaign");
    let scenario = root().join("scenarios/close.toml");
    let sweep = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let common = [
            "sweep",
            text(&scenario),
            "--duration",
            "1 s",
            "--vary",
            "seed=1..2",
            "--json",
            "--out",
        ];
        let output = run_orchestrator(&[&common[..], &[text(&out)], more].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        let table = std::fs::read_to_string(out.join("table.csv")).unwrap();
        (output.json(), table.lines().next().unwrap().to_owned())
    };
    let (plain, plain_head) = sweep("plain", &[]);
    let (with, with_head) = sweep("with", &["--digest"]);
    assert!(
        !plain_head.ends_with(",tape") && with_head == format!("{plain_head},tape"),
        "{with_head}"
    );
    let out = folder.path().join("run");
    let ran = run_orchestrator(&[
        "run",
        text(&scenario),
        "--duration",
        "1 s",
        "--seed",
        "2",
        "--in-process",
        "--json",
        "--out",
        text(&out),
    ]);
    let (first, second) = (&plain["rows"][1], &with["rows"][1]);
    assert_eq!(second["tape_digest"], ran.json()["tape_digest"]);
    assert!(first["tape_digest"].is_null());
    for key in ["figures", "outcome", "values"] {
        assert_eq!(first[key], second[key], "{key}");
    }
    // A folder that has these samples continues to record them; one without them does not start to.
    assert_eq!(sweep("with", &[]).1, with_head);
    let plain = folder.path().join("plain");
    let both = [
        "sweep",
        text(&scenario),
        "--duration",
        "1 s",
        "--vary",
        "seed=1..2",
        "--digest",
        "--out",
        text(&plain),
    ];
    let output = run_orchestrator(&both);
    assert!(output.code == Some(2) && output.err.contains("--digest"), "{output:?}");
}
