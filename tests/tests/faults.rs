//! Named faults: the same bits however a run is executed, the samples seen by the participant on the tape, events, rejections.

use std::path::Path;

use escapement_tests::fixture::write_oscillator;
use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use tape::{EventKind, Reader, Source};

const CLOSE: [&str; 8] = [
    "name=encoder,at=0.2s,until=0.4s,input=controller.measured,field=q[3],kind=bias,value=0.2 deg",
    "name=shaky,at=0.1s,output=plant.measured,field=omega_NB_B,kind=noise,value=0.01 deg/s",
    "name=late,at=0.3s,until=0.5s,connection=measured,drop=0.3,extra-delay=20ms",
    "name=frozen,at=0.25s,until=0.6s,output=plant.target,field=p_NT_N,kind=stuck",
    "name=drift,at=0.1s,input=plant.command,kind=scale,value=1.01",
    "name=flips,at=0.1s,input=guidance.target,field=v_NT_N,kind=bit-flip,bit=3,probability=0.5",
    "name=ramp,at=0.1s,input=controller.measured,field=p_NB_N,kind=ramp,value=[1, 0, 0] mm/s",
    "name=gone,at=0.6s,input=controller.measured,field=qdot,kind=dropout,probability=0.2",
];

fn close(out: &Path, faults: &[&str], more: &[&str]) -> ProgramOutput {
    let scenario = root().join("scenarios/close.toml");
    let mut arguments = vec![
        "run",
        text(&scenario),
        "--out",
        text(out),
        "--json",
        "--duration",
        "0.8 s",
    ];
    for fault in faults {
        arguments.extend(["--fault", fault]);
    }
    arguments.extend(more);
    run_orchestrator(&arguments)
}

/// Element `element` of every sample of `stream`, with the stamps.
fn values(run: &Path, stream: &str, field: &str, element: usize) -> Vec<(f64, f64)> {
    let reader = Reader::open(run).unwrap();
    let number = reader.stream(stream).unwrap();
    let spec = &reader.streams()[number];
    let field = spec.descriptor.field(field).unwrap();
    let count = reader.count(number);
    let mut records = vec![0; spec.stride() * count as usize];
    reader.read(number, 0, &mut records).unwrap();
    let one = |record: &[u8]| {
        let (stamp, payload) = record.split_first_chunk::<8>().unwrap();
        (f64::from_le_bytes(*stamp), field.value(payload, element))
    };
    records.chunks_exact(spec.stride()).map(one).collect()
}

#[test]
fn faulted_run_is_bit_identical_in_processes_and_in_one() {
    let folder = Folder::new("faulty");
    let digest = |name: &str, more: &[&str]| {
        let output = close(&folder.path().join(name), &CLOSE, more);
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
        output.json()["tape_digest"].as_str().unwrap().to_owned()
    };
    let first = digest("processes", &[]);
    assert_eq!(digest("in-process", &["--in-process"]), first);
    assert_eq!(digest("sleep", &["--wait", "sleep", "--no-placement"]), first);
    // The plan in the run folder repeats the run, faults included.
    let plan = folder.path().join("processes/plan.toml");
    let again = folder.path().join("again");
    let output = run_orchestrator(&["run", text(&plan), "--out", text(&again), "--json", "--in-process"]);
    assert_eq!(output.json()["tape_digest"], first.as_str(), "{output:?}");
    assert_ne!(digest("healthy", &[]).len(), 0);
    let healthy = close(&folder.path().join("none"), &[], &["--in-process"]).json();
    assert_ne!(healthy["tape_digest"], first.as_str());
    let events = Reader::open(&folder.path().join("processes"))
        .unwrap()
        .events()
        .unwrap();
    let faults: Vec<(String, &str)> = events
        .iter()
        .map(|event| {
            assert_eq!(event.kind, EventKind::Fault);
            (event.time.to_string(), event.text.split(':').next().unwrap())
        })
        .collect();
    assert_eq!(faults.len(), 11, "{faults:?}");
    assert!(
        faults.contains(&("200 ms".into(), "fault `encoder` begins")),
        "{faults:?}"
    );
    assert!(
        faults.contains(&("400 ms".into(), "fault `encoder` ends")),
        "{faults:?}"
    );
    assert!(
        !faults.iter().any(|(_, text)| text.contains("`gone` ends")),
        "{faults:?}"
    );
}

#[test]
fn tape_has_the_published_and_the_faulted_input() {
    let folder = Folder::new("seen");
    let (run, bias) = (folder.path().join("run"), "0.2 deg");
    let fault = format!("at=0.2s,until=0.4s,input=controller.measured,field=q[3],kind=bias,value={bias}");
    let output = close(&run, &[&fault], &["--in-process"]);
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    let given = values(&run, "plant.measured", "q", 3);
    let seen = values(&run, "controller.seen.measured", "q", 3);
    assert_eq!(seen.len(), 80);
    for (k, &(t, saw)) in seen.iter().enumerate() {
        assert_eq!(t, k as f64 / 100.0);
        let (stamp, truth) = given[10 * k];
        assert_eq!(stamp, t);
        let bias = if (20..40).contains(&k) {
            0.2 * (std::f64::consts::PI / 180.0)
        } else {
            0.0
        };
        assert_eq!(saw, truth + bias, "activation {k}");
    }
    // Other elements, and other readers, see the original output.
    let others = values(&run, "controller.seen.measured", "q", 2);
    let given = values(&run, "plant.measured", "q", 2);
    assert!(others.iter().enumerate().all(|(k, &(_, saw))| saw == given[10 * k].1));
    let reader = Reader::open(&run).unwrap();
    assert!(reader.stream("guidance.seen.measured").is_err());
    for format in ["csv", "parquet", "mcap"] {
        let to = folder.path().join(format);
        let output = run_orchestrator(&["export", text(&run), "--to", format, "--out", text(&to)]);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    assert!(folder.path().join("csv/controller.seen.measured.csv").is_file());
}

#[test]
fn participant_is_replayed_with_its_faulted_inputs() {
    let folder = Folder::new("replayed");
    let run = folder.path().join("run");
    let output = close(&run, &CLOSE, &["--in-process"]);
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    for participant in ["controller", "guidance", "plant"] {
        let output = run_orchestrator(&["replay", text(&run), "--participant", participant]);
        assert_eq!(output.code, Some(0), "{participant}: {output:?}");
    }
}

/// The effect of a NaN injected by a fault: the participant sees it, and its consequences are reported with the fault's name.
#[test]
fn flipped_exponent_is_named_when_its_participant_fails() {
    let folder = Folder::new("flip");
    let scenario = write_oscillator(&folder, "damper");
    let fault = "name=ray,at=5s,until=6s,input=damper.motion,field=velocity,kind=stuck,value=1e308 m/s";
    let scale = "name=amplifier,at=5s,until=6s,input=damper.motion,field=velocity,kind=scale,value=1e10";
    let run = folder.path().join("run");
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&run),
        "--fault",
        fault,
        "--fault",
        scale,
    ]);
    assert_eq!(output.code, Some(1), "{output:?}");
    for part in [
        "`damper`",
        "t = 5 s",
        "output `push`",
        "force = -inf",
        "active then",
        "`ray`",
        "`amplifier`",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    // Up to this instant the tape is complete.
    assert_eq!(values(&run, "damper.push", "force", 0).len(), 500);
}

#[test]
fn delayed_link_reads_older_samples_and_then_the_newest() {
    let folder = Folder::new("late");
    let scenario = write_oscillator(&folder, "damper");
    let run = folder.path().join("run");
    let late = "at=1s,until=1.1s,connection=motion,extra-delay=35ms";
    // A bias of zero records what the damper sees.
    let look = "at=0s,input=damper.motion,field=position,kind=bias,value=0 m";
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&run),
        "--fault",
        late,
        "--fault",
        look,
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let given = values(&run, "plant.motion", "position", 0);
    let seen = values(&run, "damper.seen.motion", "position", 0);
    for (k, &(_, saw)) in seen.iter().enumerate() {
        let t = 10 * k;
        // Samples stamped 1000 to 1099 ms come 35 ms late.
        let newest = (0..=t)
            .rev()
            .find(|s| s + if (1000..1100).contains(s) { 35 } else { 0 } <= t)
            .unwrap();
        assert_eq!(saw, given[newest].1, "activation {k}");
    }
}

fn assert_fault_refused(fault: &str, parts: &[&str]) {
    let scenario = root().join("scenarios/close.toml");
    let output = run_orchestrator(&["check", text(&scenario), "--fault", fault]);
    assert_eq!(output.code, Some(2), "{fault}: {output:?}");
    for part in parts {
        assert!(output.err.contains(part), "{fault}: `{part}` is not in: {}", output.err);
    }
}

/// Invalid faults, with parts of the error message.
const REFUSED: [(&str, &[&str]); 33] = [
    ("at=1s", &["faults.fault-1", "exactly one of `input`", "none"]),
    (
        "input=controller.measured,kind=stuck",
        &[
            "'input=controller.measured,kind=stuck' for '--fault",
            "missing field `at`",
        ],
    ),
    (
        "at=1s,input=controller.measured,output=plant.target",
        &["input and output"],
    ),
    ("at=1s,input=controller.measured", &["`kind` is missing"]),
    (
        "at=1s,input=controller.measured,kind=wobble",
        &["--fault", "kind: unknown variant `wobble`", "bit-flip"],
    ),
    (
        "at=-1s,connection=measured,drop=0.1",
        &["faults.fault-1.at", "before the start"],
    ),
    (
        "at=2s,until=1s,connection=measured,drop=0.1",
        &["faults.fault-1.until", "not after"],
    ),
    ("name=x y,at=1s,connection=measured,drop=0.1", &["`x y` is not a name"]),
    (
        "at=1s,connection=nothing,drop=0.1",
        &["faults.fault-1.connection", "`nothing`", "`measured`"],
    ),
    ("at=1s,connection=measured", &["drop = 0.3", "extra-delay"]),
    (
        "at=1s,connection=measured,drop=1.5",
        &["faults.fault-1.drop", "1.5", "between 0 and 1"],
    ),
    (
        "at=1s,connection=measured,extra-delay=-1ms",
        &["extra-delay", "negative"],
    ),
    (
        "at=1s,connection=measured,drop=0.1,kind=stuck",
        &["faults.fault-1.kind", "does not belong"],
    ),
    (
        "at=1s,input=pilot.measured,kind=stuck",
        &["faults.fault-1.input", "`pilot`", "`guidance`"],
    ),
    (
        "at=1s,input=controller.mesured,kind=stuck",
        &["no input `mesured`", "`measured`"],
    ),
    ("at=1s,output=plant,kind=stuck", &["PARTICIPANT.PORT"]),
    (
        "at=1s,input=controller.measured,field=q[7],kind=stuck",
        &["faults.fault-1.field", "`q[7]`", "`q: f64[7] in rad`"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=bias,value=0.2",
        &["`0.2` has no unit", "rad"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=bias,value=2 mm",
        &["faults.fault-1.value", "dimension m"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=ramp,value=2 deg",
        &["rad/s"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=bias,value=[1, 2] deg",
        &["2 values", "7 elements"],
    ),
    (
        "at=1s,input=controller.measured,kind=bias,value=2 deg",
        &["`field` is missing"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=noise,value=-1 deg",
        &["standard deviation"],
    ),
    (
        "at=1s,input=controller.measured,field=q,kind=bias",
        &["`value` is missing"],
    ),
    (
        "at=1s,input=controller.measured,kind=bit-flip,bit=64",
        &["bits 0", "63"],
    ),
    (
        "at=1s,input=controller.measured,kind=dropout,probability=2",
        &["not a probability"],
    ),
    (
        "at=1s,input=controller.measured,kind=stuck,probability=0.5",
        &["always there"],
    ),
    (
        "at=1s,input=controller.measured,knid=stuck",
        &["knid", "unknown field", "--fault"],
    ),
    ("at", &["KEY=VALUE"]),
    (
        "at=1s,substitute=pilot,run={builtin=\"controller\"}",
        &["`pilot`", "`controller`"],
    ),
    ("at=1s,substitute=controller", &["`run` is missing"]),
    (
        "at=1s,substitute=controller,run={builtin=\"pilot\"}",
        &["no builtin `pilot`"],
    ),
    (
        "at=1s,substitute=controller,run={builtin=\"controller\"},until=2s",
        &["until", "does not belong"],
    ),
];

#[test]
fn invalid_fault_is_refused_with_key_value_and_remedy() {
    for (fault, parts) in REFUSED {
        assert_fault_refused(fault, parts);
    }
}

/// In the file, every mistake is reported with its line, and all are reported at once.
#[test]
fn errors_in_faults_name_their_lines() {
    let folder = Folder::new("lines");
    let scenario = write_oscillator(&folder, "damper");
    let healthy = std::fs::read_to_string(&scenario).unwrap();
    let lines = healthy.lines().count();
    let faults = "\n[[faults]]\nat = \"1 s\"\nconnection = \"motion\"\ndrop = 2.0\n\n[[faults]]\nname = \"worn\"\nat = \"1 s\"\n\
                  connection = \"nothing\"\ndrop = 0.5\n";
    let scenario = folder.write("faulty.toml", &format!("{healthy}{faults}"));
    let output = run_orchestrator(&["check", text(&scenario)]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        format!("faulty.toml:{}: faults.fault-1.drop: 2 ", lines + 5),
        format!("faulty.toml:{}: faults.worn.connection: ", lines + 10),
    ] {
        assert!(output.err.contains(&part), "`{part}` is not in: {}", output.err);
    }
}
