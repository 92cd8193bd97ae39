//! FMUs as participants: the Reference FMUs with their reference results, and FMUs built by the tests.

use std::path::{Path, PathBuf};

use escapement_tests::fmus::TestFmu;
use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use tape::{Reader, Source};

/// Runs `scenario` in processes and in one, and checks that both tapes are equal. Returns the run folder.
fn run_both_ways(folder: &Folder, scenario: &Path) -> PathBuf {
    let apart = folder.path().join("apart");
    let output = run_orchestrator(&["run", text(scenario), "--out", text(&apart), "--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let whole = folder.path().join("whole");
    let output = run_orchestrator(&["run", text(scenario), "--out", text(&whole), "--quiet", "--in-process"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_same_tape(&apart, &whole);
    apart
}

fn assert_same_tape(one: &Path, other: &Path) {
    let output = run_orchestrator(&["compare", text(one), text(other)]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

/// The values of a field of a stream, with their stamps.
fn values(run: &Path, stream: &str, field: &str) -> Vec<(f64, f64)> {
    let reader = Reader::open(&run.join("tape")).expect("the run has a tape");
    let number = reader.stream(stream).expect("the stream is there");
    let spec = &reader.streams()[number];
    let field = spec
        .descriptor
        .field(field)
        .unwrap_or_else(|| panic!("{stream} has no {field}"));
    let mut record = vec![0; spec.stride()];
    let stamp = spec.stride() - spec.descriptor.size as usize;
    let read = |index| {
        reader.read(number, index, &mut record).expect("the record is there");
        let t = f64::from_le_bytes(record[..8].try_into().expect("eight bytes"));
        (t, field.value(&record[stamp..], 0))
    };
    (0..reader.count(number)).map(read).collect()
}

fn reference(version: &str, model: &str) -> PathBuf {
    root().join(format!("tests/fmus/reference/fmi{version}/{model}.fmu"))
}

fn assert_reproduces(model: &str, period: &str, duration: &str, ports: &str, tolerance: f64) {
    for version in ["2", "3"] {
        let folder = Folder::new(model);
        let file = reference(version, model);
        let scenario = folder.write(
            "reference.toml",
            &format!(
                "duration = \"{duration}\"\n[participants.it]\nperiod = \"{period}\"\nrun.fmu = \"{}\"\n{ports}\n",
                text(&file)
            ),
        );
        let run = run_both_ways(&folder, &scenario);
        let table = root().join(format!("tests/fmus/reference/{model}_out.csv"));
        let table = std::fs::read_to_string(table).expect("the results are there");
        let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let names = lines.next().expect("a table has a head");
        let rows: Vec<_> = lines.collect();
        let mut compared = 0;
        let reader = Reader::open(&run.join("tape")).expect("the run has a tape");
        let stream = &reader.streams()[reader.stream("it.outputs").expect("it has outputs")];
        for (column, name) in names.iter().enumerate().skip(1) {
            // FMI 2.0 has fewer types, and a text is a signal only where it is named.
            if stream.descriptor.field(name).is_none() {
                continue;
            }
            compared += 1;
            let found = values(&run, "it.outputs", name);
            assert!(found.len() >= rows.len(), "{} of {}", found.len(), rows.len());
            for (row, (t, value)) in rows.iter().zip(found) {
                let number = |text: &str| match text {
                    "true" => 1.0,
                    "false" => 0.0,
                    text => text.parse::<f64>().expect("a number"),
                };
                assert!((number(row[0]) - t).abs() < 1e-9, "{} is not {t}", row[0]);
                let expected = number(row[column]);
                assert!(
                    (expected - value).abs() <= tolerance,
                    "FMI {version}, {name} at {t}: {value}, not {expected}"
                );
            }
        }
        assert!(
            compared >= if version == "2" { 1 } else { names.len().min(3) - 1 },
            "{compared}"
        );
    }
}

#[test]
fn bouncing_ball_reproduces_its_reference() {
    assert_reproduces("BouncingBall", "10 ms", "3 s", "", 1e-9);
}

#[test]
fn dahlquist_reproduces_its_reference() {
    assert_reproduces("Dahlquist", "0.1 s", "10 s", "", 1e-12);
}

#[test]
fn feedthrough_reproduces_its_reference() {
    assert_reproduces("Feedthrough", "0.1 s", "2 s", "run.ports.inputs = []", 0.0);
}

/// Start values of one FMU are its outputs, which are the inputs of another: none is lost.
#[test]
fn every_type_passes_through_two_fmus() {
    let file = reference("3", "Feedthrough");
    let extremes = [
        ("Float32_continuous", "0.1", 0.1_f32 as f64),
        ("Float64_continuous", "0.1", 0.1),
        ("Int8", "-128", -128.0),
        ("UInt8", "255", 255.0),
        ("Int16", "-32768", -32768.0),
        ("UInt16", "65535", 65535.0),
        ("Int32", "-2147483648", -2147483648.0),
        ("UInt32", "4294967295", 4294967295.0),
        ("Int64", "-9223372036854775808", -9223372036854775808.0),
        ("UInt64", "\"18446744073709551615\"", 18446744073709551615.0),
        ("Boolean", "true", 1.0),
        ("Enumeration", "\"Option 2\"", 2.0),
    ];
    let parameters: String = extremes
        .iter()
        .map(|(name, value, _)| format!("{name}_input = {value}\n"))
        .collect();
    // Elements of eight bytes first, single bytes last.
    let order = [
        "Float64_continuous",
        "Int64",
        "UInt64",
        "Float32_continuous",
        "Int32",
        "UInt32",
        "Int16",
        "UInt16",
        "Enumeration",
        "Int8",
        "UInt8",
        "Boolean",
    ];
    let list = |name: fn(&str) -> String| order.iter().map(|one| name(one)).collect::<Vec<_>>().join(", ");
    let outputs = list(|one| format!("\"{one}_output\""));
    let inputs = list(|one| format!("{{ name = \"{one}_output\", variable = \"{one}_input\" }}"));
    let folder = Folder::new("types");
    let scenario = folder.write(
        "types.toml",
        &format!(
            "duration = \"1 s\"\n[participants.first]\nperiod = \"0.1 s\"\n[participants.first.run]\nfmu = \"{file}\"\n\
             ports = {{ inputs = [], through = [{outputs}] }}\n[participants.first.parameters]\n{parameters}\n\
             [participants.second]\nperiod = \"0.2 s\"\n[participants.second.run]\nfmu = \"{file}\"\nfeedthrough = true\n\
             ports = {{ fed = [{inputs}], through = [{outputs}] }}\n\
             [connections.link]\nfrom = \"first.through\"\nto = \"second.fed\"\n",
            file = text(&file)
        ),
    );
    let run = run_both_ways(&folder, &scenario);
    for (name, _, expected) in extremes {
        for participant in ["first", "second"] {
            let found = values(&run, &format!("{participant}.through"), &format!("{name}_output"));
            assert!(
                found.iter().all(|(_, value)| *value == expected),
                "{participant}, {name}: {found:?}"
            );
        }
    }
    // Items have names on the tape too, and a value that no item has is a fault of the FMU.
    let index = std::fs::read_to_string(run.join("tape/index.json")).expect("the tape has an index");
    let index: serde_json::Value = serde_json::from_str(&index).expect("it is one");
    let fields = index["streams"][0]["descriptor"]["fields"]
        .as_array()
        .expect("it has fields");
    let of = |name: &str| fields.iter().find(|field| field["name"] == name).expect("it is there");
    let named = serde_json::json!([
        { "name": "Option 1", "value": 1 }, { "name": "Option 2", "value": 2 }, { "name": "none", "value": 0 }
    ]);
    assert_eq!(of("Enumeration_output")["values"], named);
    assert_eq!(of("Boolean_output")["element"], "bool");
    assert_eq!(of("Int16_output")["element"], "i16");
}

/// A spring and a damper, each in a different version of the standard.
fn write_pair(folder: &Folder, state: bool, spring: &str, damper: &str) -> PathBuf {
    let two = TestFmu {
        state,
        ..TestFmu::new(2)
    }
    .build(folder, spring);
    let three = TestFmu {
        state,
        damper: true,
        ..TestFmu::new(3)
    }
    .build(folder, damper);
    folder.write(
        "pair.toml",
        &format!(
            "duration = \"3 s\"\n[participants.mass]\nperiod = \"1 ms\"\nparameters = {{ x = \"200 mm\", mass = \"2 kg\" }}\n\
             [participants.mass.run]\nfmu = \"{}\"\nrecord = [\"inner.a\"]\n\
             ports = {{ push = [\"f\"], motion = [{{ name = \"speed\", variable = \"v\" }}], outputs = [\"x\", \"v\"] }}\n\
             [participants.brake]\nperiod = \"1/300 s\"\n[participants.brake.run]\nfmu = \"{}\"\n\
             ports = {{ motion = [{{ name = \"speed\", variable = \"v\" }}], push = [\"f\"] }}\n\
             [connections.motion]\nfrom = \"mass.motion\"\nto = \"brake.motion\"\n\
             [connections.push]\nfrom = \"brake.push\"\nto = \"mass.push\"\ndelay = \"5 ms\"\n",
            text(&two),
            text(&three)
        ),
    )
}

#[test]
fn spring_and_damper_are_one_run_in_every_way() {
    for state in [true, false] {
        let folder = Folder::new("pair");
        let scenario = write_pair(&folder, state, "spring", "damper");
        let run = run_both_ways(&folder, &scenario);
        let x = values(&run, "mass.outputs", "x");
        assert_eq!(x[0], (0.0, 0.2));
        let late = x[2500..].iter().map(|(_, x)| x.abs()).fold(0.0, f64::max);
        // A mass of 2 kg and a damping of 0.5 N s/m: the envelope falls with exp(-c / 2 m · t).
        let envelope = 0.2 * (-0.125_f64 * 2.5).exp();
        assert!((late / envelope - 1.0).abs() < 0.06, "{late} against {envelope}");
        assert_eq!(values(&run, "mass.recorded", "inner.a").len(), x.len());
        for way in [&[][..], &["--in-process"]] {
            let (saved, resumed) = (folder.path().join("saved"), folder.path().join("resumed"));
            let run_of = |out: &Path, rest: &[&str]| {
                let arguments = [&["run", text(&scenario), "--out", text(out), "--quiet"], rest, way].concat();
                let output = run_orchestrator(&arguments);
                assert_eq!(output.code, Some(0), "{output:?}");
                assert_same_tape(&run, out);
            };
            run_of(&saved, &["--checkpoint-at", "1.7 s"]);
            let output =
                run_orchestrator(&[&["resume", text(&saved), "--out", text(&resumed), "--quiet"], way].concat());
            assert_eq!(output.code, Some(0), "{output:?}");
            assert_same_tape(&run, &resumed);
            // The FMU is replaced by another instance of itself.
            let replaced = folder.path().join("replaced");
            let own = std::fs::read_to_string(&scenario).expect("the scenario is there");
            let substitute = own
                .split("[participants.mass.run]")
                .nth(1)
                .and_then(|rest| rest.split("[participants").next());
            let substitute = substitute.expect("the mass stands in it");
            let fault = format!(
                "{own}[[faults]]\nat = \"1.3 s\"\nsubstitute = \"mass\"\nstate = \"keep\"\n[faults.run]{substitute}"
            );
            let changed = folder.write("substituted.toml", &fault);
            let output =
                run_orchestrator(&[&["run", text(&changed), "--out", text(&replaced), "--quiet"], way].concat());
            assert_eq!(output.code, Some(0), "{output:?}");
            assert_same_tape(&run, &replaced);
            for out in [&saved, &resumed, &replaced] {
                std::fs::remove_dir_all(out).expect("a run folder");
            }
        }
    }
}

#[test]
fn dead_fmu_is_restarted_where_it_died() {
    for state in [true, false] {
        let folder = Folder::new("crash");
        let healthy = run_both_ways(&folder, &write_pair(&folder, state, "spring", "damper"));
        let scenario = write_pair(&folder, state, "spring", "damper");
        TestFmu {
            state,
            fault: "CRASH_ONCE",
            ..TestFmu::new(2)
        }
        .build(&folder, "spring");
        let out = folder.path().join("again");
        let marker = format!(
            "participants.mass.parameters.marker=\"{}\"",
            text(&folder.path().join("marker"))
        );
        let policy = "participants.mass.on-failure=\"restart-from-checkpoint\"";
        let output = run_orchestrator(&[
            "run",
            text(&scenario),
            "--out",
            text(&out),
            "--set",
            &marker,
            "--set",
            policy,
            "--checkpoint-every",
            "0.2 s",
        ]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert!(
            folder.path().join("marker").exists() && output.out.contains("restarted from the checkpoint"),
            "{output:?}"
        );
        assert_same_tape(&healthy, &out);
    }
}

#[test]
fn fmu_that_is_not_reproducible_is_not_resumed() {
    let folder = Folder::new("fickle");
    let scenario = write_pair(&folder, false, "spring", "damper");
    TestFmu {
        state: false,
        fault: "NONDETERMINISTIC",
        ..TestFmu::new(2)
    }
    .build(&folder, "spring");
    let out = folder.path().join("saved");
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--out",
        text(&out),
        "--quiet",
        "--checkpoint-at",
        "1 s",
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = run_orchestrator(&[
        "resume",
        text(&out),
        "--out",
        text(&folder.path().join("no")),
        "--quiet",
    ]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("gave other outputs than before"), "{output:?}");
}

#[test]
fn fmus_run_in_a_campaign() {
    let folder = Folder::new("campaign");
    let scenario = write_pair(&folder, true, "spring", "damper");
    let out = folder.path().join("sweep");
    let vary = "participants.brake.parameters.damping=0.1 N s/m,0.5 N s/m,2 N s/m";
    let output = run_orchestrator(&["sweep", text(&scenario), "--vary", vary, "--out", text(&out), "--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let table = std::fs::read_to_string(out.join("table.csv")).expect("a campaign has a table");
    assert_eq!(table.lines().count(), 4, "{table}");
}

fn check_fmu(folder: &Folder, run: &str, parameters: &str) -> ProgramOutput {
    let text_of = format!(
        "duration = \"1 s\"\n[participants.it]\nperiod = \"1 ms\"\nrun = {{ {run} }}\nparameters = {{ {parameters} }}\n"
    );
    let scenario = folder.write("refused.toml", &text_of);
    run_orchestrator(&["check", text(&scenario)])
}

#[test]
fn wrong_keys_and_values_are_refused_with_the_remedy() {
    let folder = Folder::new("refusals");
    TestFmu::new(2).build(&folder, "spring");
    let fmu = "fmu = \"spring.fmu\", ports = { inputs = [] }";
    for (run, parameters, words) in [
        (fmu, "stifness = 1", "did you mean `stiffness`"),
        (fmu, "stiffness = 3.0", "has no unit; write for example \"0.5 N/m\""),
        (fmu, "stiffness = \"3 kg\"", "dimension"),
        (fmu, "stiffness = \"-1 N/m\"", "below the minimum 0 N/m"),
        (fmu, "mass = \"1 t\"", "1000 kg is above the maximum 100 kg"),
        (fmu, "v = \"1 m/s\"", "an output that the FMU calculates"),
        (
            fmu,
            "inner = { a = \"1 m/s^2\" }",
            "a local variable that the FMU calculates",
        ),
        (fmu, "marker = 3", "3 is not text"),
        ("fmu = \"spring.fmu\"", "", "it.inputs"),
        ("fmu = \"sprung.fmu\"", "", "sprung.fmu"),
        ("fmu = \"refused.toml\"", "", "not a ZIP archive"),
        ("fmu = \"spring.fmu\", args = [\"x\"]", "", "takes no args"),
        ("exe = \"/bin/true\", record = [\"x\"]", "", "belong to"),
        (
            "fmu = \"spring.fmu\", record = [\"inner.b\"]",
            "",
            "did you mean `inner.a`",
        ),
        (
            "fmu = \"spring.fmu\", ports = { inputs = [], out = [\"x\", \"f\"] }",
            "",
            "one direction",
        ),
        (
            "fmu = \"spring.fmu\", ports = { inputs = [], out = [{ variable = \"x\", unit = \"s\" }] }",
            "",
            "dimension",
        ),
        ("fmu = \"spring.fmu\", tolerance = -1.0", "", "must be positive"),
    ] {
        let output = check_fmu(&folder, run, parameters);
        assert_eq!(output.code, Some(2), "{run}, {parameters}: {output:?}");
        assert!(
            output.err.contains(words) && output.err.contains("refused.toml"),
            "{run}, {parameters}: {output:?}"
        );
    }
    let output = check_fmu(
        &folder,
        "fmu = \"spring.fmu\", ports = { inputs = [], out = [{ variable = \"x\", unit = \"mm\", frame = \"N\" }] }",
        "",
    );
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn inspected_fmu_comes_with_a_scenario_that_runs() {
    let folder = Folder::new("inspect");
    let spring = TestFmu {
        state: false,
        ..TestFmu::new(3)
    }
    .build(&folder, "spring");
    for (file, words) in [
        (spring, ["x: f64 in m", "played again", "at least 0"]),
        (
            reference("2", "BouncingBall"),
            ["h: f64 in m", "its own functions", "from 0.5 to 1"],
        ),
        (
            reference("3", "Feedthrough"),
            [
                "1 Option 1, 2 Option 2",
                "direct feedthrough",
                "`String_output` is a String",
            ],
        ),
        (
            reference("3", "Dahlquist"),
            ["x: f64", "fixed at 0.1 s", "k: Float64 = 1"],
        ),
    ] {
        let output = run_orchestrator(&["fmu", "inspect", text(&file)]);
        assert_eq!(output.code, Some(0), "{output:?}");
        for word in words {
            assert!(output.out.contains(word), "`{word}`: {}", output.out);
        }
        let (_, scenario) = output
            .out
            .split_once("A scenario with it:")
            .expect("there is a scenario");
        let scenario = folder.write("pasted.toml", scenario);
        let out = folder.path().join("run");
        let output = run_orchestrator(&[
            "run",
            text(&scenario),
            "--out",
            text(&out),
            "--quiet",
            "--duration",
            "1 s",
        ]);
        assert_eq!(
            output.code,
            Some(0),
            "{output:?}\n{}",
            std::fs::read_to_string(&scenario).unwrap_or_default()
        );
        std::fs::remove_dir_all(&out).expect("a run folder");
    }
}
