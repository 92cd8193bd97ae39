//! Connections by fields: valid ones between independently written participants, their description, and rejected ones.

use std::path::{Path, PathBuf};
use std::process::Command;

use escapement_tests::compiler::examples;
use escapement_tests::fmus::TestFmu;
use escapement_tests::program::{Folder, ProgramOutput, built, participant, root, run_orchestrator, text};
use tape::{Reader, Source};

/// All values of a field of a stream, in its own unit.
fn values(run: &Path, stream: &str, field: &str) -> Vec<f64> {
    let reader = Reader::open(&run.join("tape")).expect("the run has a tape");
    let number = reader.stream(stream).expect("the stream is there");
    let spec = &reader.streams()[number];
    let (field, elements) = spec.descriptor.resolve(field).expect("the field is there");
    let mut record = vec![0; spec.stride()];
    let stamp = spec.stride() - spec.descriptor.size as usize;
    let all = 0..reader.count(number);
    all.map(|index| {
        reader.read(number, index, &mut record).expect("the record is there");
        field.value(&record[stamp..], elements.start)
    })
    .collect()
}

fn run_complete(scenario: &Path, out: &Path, more: &[&str]) {
    let mut arguments = vec!["run", text(scenario), "--out", text(out), "--quiet"];
    arguments.extend(more);
    let output = run_orchestrator(&arguments);
    assert!(matches!(output.code, Some(0 | 3)), "{more:?}: {output:?}");
}

fn assert_same_tape(one: &Path, other: &Path) {
    let output = run_orchestrator(&["compare", text(one), text(other)]);
    assert_eq!(output.code, Some(0), "{}: {output:?}", other.display());
}

/// Runs `scenario` in processes, in one if possible, resumed from `at`, and replays each of `participants`: one tape. Returns the run.
fn assert_one_tape(folder: &Folder, scenario: &Path, at: &str, participants: &[&str]) -> PathBuf {
    let path = |name: &str| folder.path().join(name);
    let (apart, whole, resumed) = (path("apart"), path("whole"), path("resumed"));
    run_complete(scenario, &apart, &["--checkpoint-at", at]);
    let programs = std::fs::read_to_string(scenario)
        .expect("the scenario is there")
        .contains("exe =");
    let ways: &[&[&str]] = if programs { &[&[]] } else { &[&[], &["--in-process"]] };
    for &more in ways {
        run_complete(scenario, &whole, &[&["--force"][..], more].concat());
        assert_same_tape(&apart, &whole);
        let mut arguments = vec!["resume", text(&apart), "--out", text(&resumed), "--force", "--quiet"];
        arguments.extend(more);
        let output = run_orchestrator(&arguments);
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
        assert_same_tape(&apart, &resumed);
    }
    for participant in participants {
        let output = run_orchestrator(&["replay", text(&apart), "--participant", participant]);
        assert_eq!(output.code, Some(0), "{participant}: {output:?}");
    }
    apart
}

/// A spring and a damper that push each other, wired by `wires`.
fn write_two_fmus(folder: &Folder, ports: [&str; 2], wires: &str) -> PathBuf {
    let damper = TestFmu {
        damper: true,
        ..TestFmu::new(2)
    };
    let (spring, damper) = (TestFmu::new(3).build(folder, "spring"), damper.build(folder, "damper"));
    folder.write(
        "fmus.toml",
        &format!(
            "duration = \"2 s\"\n[participants.mass]\nperiod = \"1 ms\"\nrun = {{ fmu = \"{}\"{} }}\n\
             [participants.damper]\nperiod = \"1 ms\"\nrun = {{ fmu = \"{}\"{} }}\n{wires}",
            text(&spring),
            ports[0],
            text(&damper),
            ports[1]
        ),
    )
}

const BY_FIELDS: &str = "[connections.speed]\nfrom = \"mass.outputs.v\"\nto = \"damper.inputs.v\"\ninitial = \"first-sample\"\n\
                         [connections.force]\nfrom = \"damper.outputs.f\"\nto = \"mass.inputs.f\"\n";

#[test]
fn fmus_wired_by_fields_have_the_tape_of_fmus_wired_by_ports() {
    let folder = Folder::new("fields-fmus");
    let wired = write_two_fmus(&folder, ["", ""], BY_FIELDS);
    let run = assert_one_tape(&folder, &wired, "700 ms", &["mass", "damper"]);
    let other = Folder::new("fields-ports");
    let ports = [", ports = { velocity = [\"v\"], position = [\"x\"] }", ""];
    let wires = "[connections.speed]\nfrom = \"mass.velocity\"\nto = \"damper.inputs\"\ninitial = \"first-sample\"\n\
                 [connections.force]\nfrom = \"damper.outputs\"\nto = \"mass.inputs\"\n";
    let plain = other.path().join("plain");
    run_complete(&write_two_fmus(&other, ports, wires), &plain, &["--in-process"]);
    let bits = |run: &Path, stream: &str, field: &str| -> Vec<u64> {
        values(run, stream, field).into_iter().map(f64::to_bits).collect()
    };
    assert_eq!(bits(&run, "mass.outputs", "x"), bits(&plain, "mass.position", "x"));
    assert_eq!(bits(&run, "damper.outputs", "f"), bits(&plain, "damper.outputs", "f"));
}

/// A Reference FMU has the alias `h_ft` of `h`.
#[test]
fn alias_of_a_variable_names_its_field() {
    let folder = Folder::new("fields-alias");
    let file = |model: &str| root().join(format!("tests/fmus/reference/fmi3/{model}.fmu"));
    let (ball, gauge) = (file("BouncingBall"), file("Feedthrough"));
    let scenario = |name: &str, start: &str, wire: &str| {
        let text = format!(
            "duration = \"1 s\"\n[participants.ball]\nperiod = \"10 ms\"\nrun.fmu = \"{}\"\nparameters = {{ {start} = \"2 m\" }}\n\
             [participants.gauge]\nperiod = \"0.1 s\"\n\
             run = {{ fmu = \"{}\", ports = {{ inputs = [\"Float64_continuous_input\"] }} }}\n[connections.where]\n{wire}\n",
            text(&ball),
            text(&gauge)
        );
        folder.write(&format!("{name}.toml"), &text)
    };
    let map = |field: &str| {
        format!(
            "from = \"ball.outputs\"\nto = \"gauge.inputs\"\n\
             map = {{ Float64_continuous_input = {{ from = \"{field}\", factor = \"1 1/m\" }} }}"
        )
    };
    let ends = "from = \"ball.outputs.h_ft\"\nto = \"gauge.inputs.Float64_continuous_input\"\nfactor = \"1 1/m\"";
    let own = folder.path().join("own");
    run_complete(&scenario("own", "h", &map("h")), &own, &[]);
    assert_eq!(values(&own, "ball.outputs", "h")[0], 2.0);
    for (name, start, wire) in [("map", "h_ft", map("h_ft").as_str()), ("ends", "h", ends)] {
        for way in [&[][..], &["--in-process"]] {
            let out = folder.path().join(format!("{name}{}", way.len()));
            run_complete(&scenario(name, start, wire), &out, way);
            assert_same_tape(&own, &out);
        }
    }
    for (wire, words) in [
        (
            map("h").replace("map", "initial = { Float64_continuous_input = 0.5 }\nmap"),
            None,
        ),
        (map("h_fd"), Some("no field or element `h_fd`")),
    ] {
        let output = run_orchestrator(&["check", text(&scenario("checked", "h", &wire))]);
        assert_eq!(output.code, Some(if words.is_some() { 2 } else { 0 }), "{output:?}");
        assert!(words.is_none_or(|words| output.err.contains(words)), "{output:?}");
    }
    // Two names of one value are one value.
    let twice = scenario("twice", "h = \"1 m\", h_ft", &map("h"));
    let output = run_orchestrator(&["check", text(&twice)]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in [
        "twice.toml:5: participants.ball.parameters.h_ft",
        "`h` and `h_ft` are one value",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in {output:?}");
    }
    let output = run_orchestrator(&["fmu", "inspect", text(&ball)]);
    assert!(output.out.contains("also `h_ft` (Position in feet)"), "{output:?}");
}

#[test]
fn fmu_in_other_units_moves_a_plug_in_and_a_builtin_alike() {
    let folder = Folder::new("fields-units");
    let damper = TestFmu {
        damper: true,
        ..TestFmu::new(3)
    };
    let damper = damper.build(&folder, "damper");
    let plant = examples().path("c/libplant.so");
    let scenario = |name: &str, ports: &str, push: &str| {
        folder.write(
            name,
            &format!(
                "duration = \"1 s\"\n[participants.plant]\nperiod = \"1 ms\"\nrun = {{ library = \"{}\" }}\n\
                 parameters = {{ mass = \"2 kg\", stiffness = \"80 N/m\", damping = \"0 N s/m\" }}\n\
                 [participants.damper]\nperiod = \"1 ms\"\nrun = {{ fmu = \"{}\"{ports} }}\n\
                 [participants.mass]\nperiod = \"1 ms\"\nrun = {{ builtin = \"spring\" }}\n\
                 parameters = {{ position = \"10 cm\", mass = \"1 kg\", stiffness = \"40 N/m\", coupling = \"5 N/m\", damping = \"0 N s/m\" }}\n\
                 [connections.speed]\nfrom = \"mass.motion.velocity\"\nto = \"damper.inputs.v\"\n\
                 [connections.push]\nfrom = \"damper.outputs.f\"\nto = \"plant.push.force\"\n{push}\
                 [connections.pull]\nfrom = \"plant.motion\"\nto = \"mass.neighbour\"\nmap = \"by-name\"\n",
                text(&plant),
                text(&damper)
            ),
        )
    };
    let metric = scenario("metric.toml", "", "");
    let run = assert_one_tape(&folder, &metric, "0.3 s", &["plant", "damper", "mass"]);
    let ports = ", ports = { inputs = [{ variable = \"v\", unit = \"mm/s\" }], outputs = [{ variable = \"f\", unit = \"kN\" }] }";
    let small = folder.path().join("small");
    run_complete(&scenario("small.toml", ports, ""), &small, &[]);
    for (stream, field) in [("plant.motion", "position"), ("mass.motion", "velocity")] {
        let (one, other) = (values(&run, stream, field), values(&small, stream, field));
        let largest = one.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        assert!(largest > 1e-3 && one.len() == other.len(), "{largest}");
        for (one, other) in one.iter().zip(&other) {
            assert!((one - other).abs() < 1e-12 * largest, "{one} {other}");
        }
    }
    let output = run_orchestrator(&["check", text(&folder.path().join("small.toml")), "--start"]);
    for words in [
        "v [mm/s] = 1000 * velocity [m/s] (frame N to no frame)",
        "force [N] = 1000 * f [kN] (no frame to frame N)",
        "position [m] = position [m]",
    ] {
        assert!(output.out.contains(words), "{words}: {output:?}");
    }
}

/// The program of an example with `arguments`.
fn example(program: &str, arguments: &[&str]) -> ProgramOutput {
    let mut command = Command::new(built().join(program));
    let output = command.current_dir(root()).args(arguments).output();
    ProgramOutput::from(output.expect("the program can be started"))
}

#[test]
fn examples_wired_by_fields_have_the_tapes_of_their_ports() {
    let folder = Folder::new("fields-examples");
    let path = |name: &str| folder.path().join(name);
    let by_name = "connections.motion.map=\"by-name\"";
    let fields = [
        "connections.turn.map={ angle = \"angle\" }",
        "connections.rate={ from = \"shaft.turn.rate\", to = \"regulator.turn.rate\", initial = \"first-sample\" }",
        "connections.drive.map={ torque = { from = \"torque\" }, wanted = [\"wanted\"] }",
    ];
    let cases: [(&str, &str, &[&str]); 2] = [
        ("lander", "examples/lander/lander.toml", &[by_name]),
        ("servo", "examples/servo/servo.toml", &fields),
    ];
    for (program, scenario, sets) in cases {
        let (plain, mapped) = (path(&format!("{program}-plain")), path(&format!("{program}-mapped")));
        let output = example(program, &["run", scenario, "--out", text(&plain), "--quiet"]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let mut arguments = vec!["run", scenario, "--out", text(&mapped), "--quiet"];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        let output = example(program, &arguments);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_same_tape(&plain, &mapped);
        // The plan holds the command-line changes, so it runs again by itself.
        let again = path(&format!("{program}-again"));
        let output = example(
            program,
            &["run", text(&mapped.join("plan.toml")), "--out", text(&again), "--quiet"],
        );
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_same_tape(&plain, &again);
    }
}

/// An oscillator whose damper sees its position 5 ms and its velocity 20 ms late, and reads a sum.
fn write_oscillator_by_fields(folder: &Folder, more: &str) -> PathBuf {
    folder.write(
        "oscillator.toml",
        &format!(
            "duration = \"2 s\"\n[participants.plant]\nrun = {{ exe = \"{}\" }}\nperiod = \"1 ms\"\n\
             [participants.damper]\nrun = {{ exe = \"{}\" }}\nperiod = \"10 ms\"\n\
             [connections.place]\nfrom = \"plant.motion\"\nto = \"damper.motion\"\nmap = {{ position = \"position\" }}\n\
             delay = \"5 ms\"\njitter = \"7 ms\"\ninitial = {{ position = 0.25 }}\n\
             [connections.speed]\nfrom = \"plant.motion.velocity\"\nto = \"damper.motion.velocity\"\ndelay = \"20 ms\"\n\
             drop = 0.2\nsum = true\nfactor = 0.75\n\
             [connections.speed-again]\nfrom = \"plant.motion.velocity\"\nto = \"damper.motion.velocity\"\nsum = true\nfactor = 0.25\n\
             [connections.push]\nfrom = \"damper.push\"\nto = \"plant.push\"\n{more}",
            participant("oscillator").display(),
            participant("damper").display()
        ),
    )
}

#[test]
fn separately_linked_fields_give_one_tape_faulted_and_resumed() {
    let folder = Folder::new("fields-faults");
    let faults = "[[faults]]\nat = \"0.4 s\"\nuntil = \"1.2 s\"\nconnection = \"speed\"\nextra-delay = \"30 ms\"\ndrop = 0.5\n\
                  [[faults]]\nat = \"0.5 s\"\nuntil = \"1.5 s\"\ninput = \"damper.motion\"\nfield = \"velocity\"\nkind = \"stuck\"\n\
                  [[faults]]\nat = \"0.7 s\"\nuntil = \"1.1 s\"\noutput = \"plant.motion\"\nfield = \"position\"\nkind = \"bias\"\nvalue = \"2 cm\"\n";
    let run = assert_one_tape(
        &folder,
        &write_oscillator_by_fields(&folder, faults),
        "0.8 s",
        &["damper", "plant"],
    );
    let seen = |field: &str| values(&run, "damper.seen.motion", field);
    assert_eq!(seen("position")[0], 0.25);
    let (velocity, truth) = (seen("velocity"), values(&run, "plant.motion", "velocity"));
    // Stuck from activation 50 to 149.
    assert!(velocity[50..150].iter().all(|x| x.to_bits() == velocity[50].to_bits()));
    // Three quarters of a sample that is 20 ms old, and a quarter of the present one; where nothing was dropped.
    let whole = |k: usize| 0.0 + truth[10 * k - 20] * 0.75 + truth[10 * k] * 0.25;
    let hits = (3..40).filter(|&k| velocity[k].to_bits() == whole(k).to_bits()).count();
    assert!((20..37).contains(&hits), "{hits}");
}

#[test]
fn interpolated_links_are_one_tape_with_faults_and_resumed() {
    let folder = Folder::new("fields-linear");
    let faults = "[[faults]]\nat = \"0.4 s\"\nuntil = \"1.2 s\"\nconnection = \"speed\"\nextra-delay = \"30 ms\"\ndrop = 0.5\n\
                  [[faults]]\nat = \"0.5 s\"\nuntil = \"1.5 s\"\ninput = \"damper.motion\"\nfield = \"position\"\nkind = \"stuck\"\n\
                  [[faults]]\nat = \"0.7 s\"\nuntil = \"1.1 s\"\noutput = \"plant.motion\"\nfield = \"velocity\"\nkind = \"noise\"\nvalue = \"1 m/s\"\n";
    let scenario = std::fs::read_to_string(write_oscillator_by_fields(&folder, faults)).expect("it was just written");
    // The reader's instants less the delay lie between the samples.
    let scenario = scenario.replace("delay = \"5 ms\"", "delay = \"5.5 ms\"\nhold = \"linear\"");
    let scenario = scenario.replace("delay = \"20 ms\"", "delay = \"61/3000 s\"\nhold = \"linear\"");
    let scenario = folder.write("linear.toml", &scenario);
    let run = assert_one_tape(&folder, &scenario, "0.8 s", &["damper", "plant"]);
    let (seen, truth) = (
        values(&run, "damper.seen.motion", "position"),
        values(&run, "plant.motion", "position"),
    );
    // 5.5 ms before activation k, half of the way between two samples; a jitter of up to 7 ms may have kept the second one.
    let between = |k: usize| truth[10 * k - 6] + 0.5 * (truth[10 * k - 5] - truth[10 * k - 6]);
    let hits = (1..50).filter(|&k| seen[k].to_bits() == between(k).to_bits()).count();
    assert!((15..49).contains(&hits), "{hits}");
    let output = run_orchestrator(&["check", text(&scenario), "--start"]);
    assert!(output.out.contains("interpolated"), "{output:?}");
    let short = [
        "check",
        text(&scenario),
        "--start",
        "--set",
        "connections.place.delay=0.5ms",
    ];
    let output = run_orchestrator(&short);
    assert!(
        output.code == Some(0) && output.err.contains("connections.place.hold") && output.err.contains("1 ms"),
        "{output:?}"
    );
}

#[test]
fn campaign_varies_a_connection_by_fields() {
    let folder = Folder::new("fields-sweep");
    let out = folder.path().join("sweep");
    let output = run_orchestrator(&[
        "sweep",
        "examples/fmu/wired.toml",
        "--vary",
        "connections.where.offset=0.0,1.0,50.0",
        "--out",
        text(&out),
        "--quiet",
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let table = std::fs::read_to_string(out.join("table.csv")).expect("a campaign has a table");
    assert_eq!(
        (table.lines().count(), table.matches(",met,").count()),
        (4, 2),
        "{table}"
    );
}

#[test]
fn check_and_graph_show_field_conversions() {
    let output = run_orchestrator(&["check", "examples/fmu/wired.toml"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for words in [
        "position [m] = 0.001 * h [mm]",
        "velocity [m/s] = v [m/s]",
        "Float64_continuous_input = 100 * position [m] (frame N to no frame) + 2",
        "Float64_discrete_input += 3 * velocity [m/s]",
    ] {
        assert!(output.out.contains(words), "{words}: {output:?}");
    }
    let output = run_orchestrator(&["graph", "examples/fmu/wired.toml"]);
    assert!(
        output.out.contains("outputs to position, velocity, 20 ms late"),
        "{output:?}"
    );
    let output = run_orchestrator(&["check", "examples/fmu/wired.toml", "--json"]);
    let plan = &output.json()["plan"];
    assert_eq!(
        plan["links"][2]["conversion"]["pairs"][0]["terms"][0]["scale"], 0.001,
        "{plan}"
    );
}

#[test]
fn degrees_and_millimetres_are_read_in_radians_and_metres() {
    let example = "examples/fmu/units.toml";
    let output = run_orchestrator(&["check", example]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for words in [
        "angle [rad] = 0.017453292519943295 * angle [deg]",
        "length [m] = 0.001 * length [mm]",
    ] {
        assert!(output.out.contains(words), "{words}: {output:?}");
    }
    let folder = Folder::new("units");
    for (set, code) in [
        (None, 0),
        (Some("participants.sensor.parameters.Float64_continuous_input=91.0"), 3),
    ] {
        let out = folder.path().join(format!("run-{code}"));
        let mut arguments = vec!["run", example, "--out", text(&out), "--in-process"];
        arguments.extend(set.iter().flat_map(|set| ["--set", set]));
        let output = run_orchestrator(&arguments);
        assert_eq!(output.code, Some(code), "{output:?}");
    }
}
