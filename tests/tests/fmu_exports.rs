//! FMUs that the program exports: in place of their source participants they yield the same tape.

use std::path::{Path, PathBuf};

use escapement_tests::compiler::{examples, library_override};
use escapement_tests::program::{Folder, ProgramOutput, built, run_orchestrator, text};
use tape::{Reader, Source};

const CLOSE: &str = "scenarios/close.toml";
const PID: &str = "examples/pid/pid.toml";
const CROSSING: &str = "examples/c/crossing.toml";
const BEACON: &str = "examples/c/beacon.toml";

fn run(scenario: &str, out: &Path, sets: &[String], more: &[&str]) {
    let mut arguments = vec!["run", scenario, "--quiet", "--out", text(out)];
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    arguments.extend(more);
    let output = run_orchestrator(&arguments);
    assert!(matches!(output.code, Some(0 | 3)), "{sets:?} {more:?}: {output:?}");
}

fn assert_same_tape(one: &Path, other: &Path) {
    let output = run_orchestrator(&["compare", text(one), text(other)]);
    assert_eq!(output.code, Some(0), "{}: {output:?}", other.display());
}

fn export(scenario: &str, more: &[&str], sets: &[String]) -> ProgramOutput {
    let mut arguments = vec!["fmu", "export", scenario];
    arguments.extend(more);
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    run_orchestrator(&arguments)
}

/// Exports a participant, and returns the printed changes that replace it by the FMU.
fn export_as_replacement(folder: &Folder, scenario: &str, name: &str, fmi: &str, sets: &[String]) -> Vec<String> {
    let file = folder.path().join(format!("{name}-{fmi}.fmu"));
    let output = export(
        scenario,
        &["--participant", name, "--fmi", fmi, "--out", text(&file)],
        sets,
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    replacement_overrides(&output.out, name)
}

/// The changes that replace the participant `name` by an FMU, from the program's output.
fn replacement_overrides(printed: &str, name: &str) -> Vec<String> {
    let (_, entry) = printed
        .split_once("In the place of the participant:\n")
        .expect("the entry is printed");
    let entry: toml::Table = entry.parse().unwrap_or_else(|error| panic!("{entry}: {error}"));
    let own = entry["participants"][name].as_table().expect("an entry");
    vec![
        format!("participants.{name}.run={}", own["run"]),
        format!("participants.{name}.parameters={{}}"),
    ]
}

/// An FMU in place of each of `names`, then of all of them, in processes and in one: `reference` is the tape.
fn assert_replacements_keep_tape(folder: &Folder, scenario: &str, sets: &[String], names: &[&str], more: &[&str]) {
    assert_replacements_keep_tape_in(&["2", "3"], folder, scenario, sets, names, more);
}

/// The same for the given versions of the standard.
fn assert_replacements_keep_tape_in(
    versions: &[&str],
    folder: &Folder,
    scenario: &str,
    sets: &[String],
    names: &[&str],
    more: &[&str],
) {
    let path = |name: &str| folder.path().join(name);
    run(scenario, &path("reference"), sets, more);
    for fmi in versions {
        let mut all = sets.to_vec();
        for name in names {
            let own = export_as_replacement(folder, scenario, name, fmi, sets);
            let out = path(&format!("{name}-{fmi}"));
            run(
                scenario,
                &out,
                &[sets, &own].concat(),
                &[more, &["--in-process"]].concat(),
            );
            assert_same_tape(&path("reference"), &out);
            all.extend(own);
        }
        let out = path(&format!("all-{fmi}"));
        run(scenario, &out, &all, more);
        assert_same_tape(&path("reference"), &out);
        let resumed = path(&format!("resumed-{fmi}"));
        let saved = path(&format!("saved-{fmi}"));
        run(
            scenario,
            &saved,
            &all,
            &[more, &["--in-process", "--checkpoint-at", "0.7 s"]].concat(),
        );
        let output = run_orchestrator(&[
            "resume",
            text(&saved),
            "--out",
            text(&resumed),
            "--quiet",
            "--in-process",
        ]);
        assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
        assert_same_tape(&path("reference"), &resumed);
    }
}

#[test]
fn capture_of_fmus_is_the_same_run() {
    let folder = Folder::new("exported-close");
    let more = ["--duration", "1.5 s"];
    assert_replacements_keep_tape(&folder, CLOSE, &[], &["plant", "controller", "guidance"], &more);
}

/// A plug-in is packed into its FMU, in another language than the stock participants and with a delay on the connection.
#[test]
fn position_loop_of_fmus_of_plugins_is_the_same_run() {
    let folder = Folder::new("exported-pid");
    let native_build = examples();
    let loops = [("plant", "plant"), ("controller", "pid"), ("reference", "reference")];
    let sets: Vec<String> = loops
        .iter()
        .map(|(slot, name)| library_override(slot, &native_build.path(&format!("c/lib{name}.so")), None))
        .collect();
    assert_replacements_keep_tape(&folder, PID, &sets, &["plant", "controller", "reference"], &[]);
}

/// Enumerations, truth values and small numbers of an FMU are those of its source participant, also where FMI 2.0 represents a small
/// number as an Integer.
#[test]
fn named_values_of_fmus_are_the_same_run() {
    let folder = Folder::new("exported-crossing");
    let file = examples().path("c/libcrossing.so");
    let sets = ["light", "crowd"].map(|name| library_override(name, &file, Some(name)));
    assert_replacements_keep_tape(&folder, CROSSING, &sets, &["light", "crowd"], &[]);
}

/// Texts in both versions, bytes in the one that has a type for them.
#[test]
fn texts_and_bytes_of_fmus_are_the_same_run() {
    let folder = Folder::new("exported-beacon");
    let file = examples().path("c/libbeacon.so");
    let sets = ["beacon", "station"].map(|name| library_override(name, &file, Some(name)));
    let path = |name: &str| folder.path().join(name);
    run(BEACON, &path("reference"), &sets, &[]);
    let mut all = sets.to_vec();
    for name in ["beacon", "station"] {
        let own = export_as_replacement(&folder, BEACON, name, "3", &sets);
        run(BEACON, &path(name), &[&sets[..], &own].concat(), &["--in-process"]);
        assert_same_tape(&path("reference"), &path(name));
        all.extend(own);
    }
    run(BEACON, &path("all"), &all, &["--checkpoint-every", "20 s"]);
    assert_same_tape(&path("reference"), &path("all"));
    let output = run_orchestrator(&[
        "resume",
        text(&path("all")),
        "--from",
        "40 s",
        "--out",
        text(&path("resumed")),
        "--quiet",
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_same_tape(&path("reference"), &path("resumed"));
    let output = run_orchestrator(&["fmu", "inspect", text(&path("beacon-3.fmu"))]);
    assert!(
        output
            .out
            .contains("`beacon.frame` is a Binary: it is a signal, bytes[32], where `ports` names it"),
        "{output:?}"
    );
    let two = path("two.fmu");
    let more = ["--participant", "beacon", "--fmi", "2", "--out", text(&two)];
    let output = export(BEACON, &more, &sets);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output
            .err
            .contains("`beacon.frame` has bytes, for which FMI 2.0 has no type"),
        "{output:?}"
    );
    // Without the bytes, FMI 2.0 works too, with lists of texts and of enumerations.
    let table = folder.write("words.toml", WORDS);
    let native_build = escapement_tests::compiler::NativeBuild::new("words");
    let plugin = native_build.plugin("tests/plugins/words.c", "libwords.so", &[]);
    let sets = [
        library_override("one", &plugin, None),
        library_override("two", &plugin, None),
    ];
    let names = Folder::new("exported-words");
    assert_replacements_keep_tape(&names, text(&table), &sets, &["one", "two"], &[]);
}

/// A text that exceeds the capacity of its field ends the run.
#[test]
fn text_of_an_fmu_is_not_cut_off() {
    let folder = Folder::new("exported-long");
    let file = examples().path("c/libbeacon.so");
    let sets = ["beacon", "station"].map(|name| library_override(name, &file, Some(name)));
    let own = export_as_replacement(&folder, BEACON, "beacon", "3", &sets);
    let short = own[0].replace("name = \"phase\", size = 24", "name = \"phase\", size = 12");
    assert_ne!(short, own[0]);
    let out = folder.path().join("short");
    let mut arguments = vec!["run", BEACON, "--quiet", "--out", text(&out)];
    let map = "connections.beacon.map={ count = \"count\", frame = \"frame\", phase = \"phase\", state = \"state\" }";
    let all = [&sets[..], &[short, own[1].clone(), map.to_owned()]].concat();
    all.iter().for_each(|set| arguments.extend(["--set", set]));
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(1), "{output:?}");
    let words = "its output `beacon.phase` has 15 bytes, and its field room for 12: give it more, as { variable = \"beacon.phase\", size = 15 }";
    assert!(
        output.err.contains("`beacon`") && output.err.contains(words),
        "{output:?}"
    );
}

/// Two participants that exchange what they have received, and their state.
const WORDS: &str = "duration = \"5 s\"\n[participants.one]\nperiod = \"100 ms\"\n[participants.two]\nperiod = \"130 ms\"\n\
                     offset = \"10 ms\"\n[connections.there]\nfrom = \"one.said\"\nto = \"two.heard\"\n\
                     [connections.back]\nfrom = \"two.said\"\nto = \"one.heard\"\ndelay = \"20 ms\"\ninitial = { word = [\"Öl\", \"\"] }\n";

/// A user's program exports its own participants, with its own library.
#[test]
fn own_program_exports_its_participants() {
    let folder = Folder::new("exported-own");
    let path = |name: &str| folder.path().join(name);
    let pid = |arguments: &[&str]| {
        let output = std::process::Command::new(built().join("pid"))
            .current_dir(escapement_tests::program::root())
            .args(arguments)
            .output()
            .expect("the program can be started");
        (
            output.status.code(),
            String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned(),
        )
    };
    let (code, output) = pid(&["run", PID, "--quiet", "--in-process", "--out", text(&path("reference"))]);
    assert!(matches!(code, Some(0 | 3)), "{output}");
    let (code, output) = pid(&["fmu", "export", PID, "--participant", "controller"]);
    assert_eq!(code, Some(1), "{output}");
    assert!(
        output.contains("libpid_fmu.so") && output.contains("--library"),
        "{output}"
    );
    let (file, library) = (path("controller.fmu"), built().join("libposition_loop.so"));
    let more = [
        "--participant",
        "controller",
        "--out",
        text(&file),
        "--library",
        text(&library),
    ];
    let (code, output) = pid(&[&["fmu", "export", PID], &more[..]].concat());
    assert_eq!(code, Some(0), "{output}");
    let own = replacement_overrides(&output, "controller");
    let mut arguments = vec!["run", PID, "--quiet", "--in-process"];
    let out = path("fmu");
    arguments.extend(["--out", text(&out)]);
    own.iter().for_each(|set| arguments.extend(["--set", set]));
    let (code, output) = pid(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{output}");
    assert_same_tape(&path("reference"), &out);
    // The library of another program does not know that participant.
    let (code, output) = pid(&[
        "fmu",
        "export",
        PID,
        "--participant",
        "controller",
        "--library",
        text(&built().join("libescapement_fmu.so")),
    ]);
    assert_eq!(code, Some(2), "{output}");
    assert!(output.contains("there is no builtin `pid`"), "{output}");
}

/// A second export yields the same bytes, and `inspect` reads the FMU.
#[test]
fn export_is_reproducible_and_can_be_inspected() {
    let folder = Folder::new("exported-twice");
    for fmi in ["2", "3"] {
        let file = |name: &str| folder.path().join(format!("{name}-{fmi}.fmu"));
        for name in ["one", "other"] {
            let out = file(name);
            let output = export(
                CLOSE,
                &["--participant", "plant", "--fmi", fmi, "--out", text(&out)],
                &[],
            );
            assert_eq!(output.code, Some(0), "{output:?}");
        }
        let bytes = |name: &str| std::fs::read(file(name)).expect("the FMU is there");
        assert!(bytes("one") == bytes("other"), "FMI {fmi}");
        let output = run_orchestrator(&["fmu", "inspect", text(&file("one"))]);
        assert_eq!(output.code, Some(0), "{output:?}");
        for word in ["parameters.start.position", "rad/s", "measured."] {
            assert!(output.out.contains(word), "no `{word}` in {}", output.out);
        }
    }
}

/// A parameter that the importer sets is the parameter of the scenario.
#[test]
fn parameters_can_be_set() {
    let folder = Folder::new("exported-parameters");
    let path = |name: &str| folder.path().join(name);
    let more = ["--duration", "0.5 s", "--in-process"];
    let start = "participants.plant.parameters.start.position=[-0.5, 0, -2.5] m".to_owned();
    run(CLOSE, &path("reference"), &[start], &more);
    for (fmi, parameters) in [
        (
            "2",
            "\"parameters.start.position[0]\" = \"-50 cm\", \"parameters.start.position[2]\" = \"-2.5 m\"",
        ),
        ("3", "\"parameters.start.position\" = \"[-0.5, 0, -2.5] m\""),
    ] {
        let own = export_as_replacement(&folder, CLOSE, "plant", fmi, &[]);
        let sets = vec![
            own[0].clone(),
            format!("participants.plant.parameters={{ {parameters} }}"),
        ];
        run(CLOSE, &path(fmi), &sets, &more);
        assert_same_tape(&path("reference"), &path(fmi));
    }
}

/// The payloads of a stream, each with its stamp in front.
fn records(run: &Path, stream: &str) -> Vec<Vec<u8>> {
    let reader = Reader::open(&run.join("tape")).expect("the run has a tape");
    let number = reader.stream(stream).expect("the stream is there");
    let mut record = vec![0; reader.streams()[number].stride()];
    let read = |index| {
        reader.read(number, index, &mut record).expect("the record is there");
        record.clone()
    };
    (0..reader.count(number)).map(read).collect()
}

/// A mass alone, as a scenario with an unconnected input, becomes one FMU; with its neighbour it moves as the mass does, and outputs its
/// figure.
#[test]
fn whole_scenario_is_one_fmu_with_inputs_and_figures() {
    let folder = Folder::new("exported-whole");
    let path = |name: &str| folder.path().join(name);
    let mass = std::fs::read_to_string(escapement_tests::program::root().join("examples/c/drive.toml"))
        .expect("the example is there");
    let other = "[participants.other]\nrun = { builtin = \"spring\" }\nperiod = \"10 ms\"\n\
                 parameters = { position = \"0.2 m\", mass = \"2 kg\", stiffness = \"10 N/m\", coupling = \"5 N/m\", damping = \"0 N s/m\" }\n";
    let links = |name: &str| {
        format!(
            "[connections.there]\nfrom = \"other.motion\"\nto = \"{name}.neighbour\"\ninitial = \"first-sample\"\n\
             [connections.back]\nfrom = \"{name}.motion\"\nto = \"other.neighbour\"\ninitial = \"first-sample\"\n"
        )
    };
    let closed = mass.replace("inputs = [\"mass.neighbour\"]", "");
    let closed = folder.write("closed.toml", &format!("{closed}\n{other}{}", links("mass")));
    run(text(&closed), &path("closed"), &[], &["--in-process"]);
    let summary = std::fs::read_to_string(path("closed").join("summary.json")).expect("the run has a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    let farthest = summary
        .pointer("/figures/measures/farthest/value")
        .or(summary.pointer("/measures/farthest/value"));
    let farthest = farthest
        .and_then(serde_json::Value::as_f64)
        .unwrap_or_else(|| panic!("{summary}"));
    for fmi in ["2", "3"] {
        let file = path(&format!("mass-{fmi}.fmu"));
        let more = ["--inputs", "mass.neighbour", "--fmi", fmi, "--out", text(&file)];
        let output = export("examples/c/drive.toml", &more, &[]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let fields = |port: &str| {
            let field = |name: &str, unit: &str| {
                format!("{{ name = \"{name}\", variable = \"mass.{port}.{name}\", unit = \"{unit}\", frame = \"N\" }}")
            };
            format!("{port} = [{}, {}]", field("position", "m"), field("velocity", "m/s"))
        };
        let within = format!(
            "duration = \"2 s\"\n[participants.whole]\nperiod = \"10 ms\"\n[participants.whole.run]\nfmu = \"{}\"\n\
             messages = {{ neighbour = \"Motion\", motion = \"Motion\" }}\n\
             ports = {{ {}, {}, figures = [{{ name = \"farthest\", variable = \"figures.farthest\" }}] }}\n{other}{}",
            text(&file),
            fields("neighbour"),
            fields("motion"),
            links("whole")
        );
        let scenario = folder.write("within.toml", &within);
        let (out, resumed) = (path(&format!("within-{fmi}")), path(&format!("resumed-{fmi}")));
        run(text(&scenario), &out, &[], &["--checkpoint-at", "1 s"]);
        assert_eq!(
            records(&path("closed"), "other.motion"),
            records(&out, "other.motion"),
            "FMI {fmi}"
        );
        let own = records(&path("closed"), "mass.motion");
        let every: Vec<Vec<u8>> = own.into_iter().step_by(10).collect();
        assert_eq!(every, records(&out, "whole.motion"), "FMI {fmi}");
        let figures = records(&out, "whole.figures");
        let last = figures.last().expect("a sample")[8..16]
            .try_into()
            .expect("eight bytes");
        assert_eq!(f64::from_le_bytes(last), farthest);
        // Another instance is brought to the same state by replaying the inputs.
        let output = run_orchestrator(&["resume", text(&out), "--out", text(&resumed), "--quiet"]);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_same_tape(&out, &resumed);
    }
}

#[test]
fn step_that_is_no_multiple_of_the_period_is_refused() {
    let folder = Folder::new("exported-step");
    for (fmi, how) in [("2", "Discard"), ("3", "whole multiple")] {
        let own = export_as_replacement(&folder, CLOSE, "controller", fmi, &[]);
        let sets = [own, vec!["participants.controller.period=15ms".to_owned()]].concat();
        let out = folder.path().join(fmi);
        let mut arguments = vec![
            "run",
            CLOSE,
            "--quiet",
            "--out",
            text(&out),
            "--in-process",
            "--duration",
            "0.5 s",
        ];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        let output = run_orchestrator(&arguments);
        assert!(matches!(output.code, Some(1 | 2)), "{output:?}");
        assert!(output.err.contains(how), "{output:?}");
        assert!(output.err.contains("0.01 s"), "{output:?}");
    }
}

/// What cannot be exported is rejected with the reason, and no file is left.
#[test]
fn invalid_export_is_refused_with_the_reason() {
    let folder = Folder::new("exported-refusals");
    let out = folder.path().join("no.fmu");
    let external = format!(
        "participants.guidance.run={{ exe = {:?} }}",
        text(&built().join("guidance-proc"))
    );
    let fmu = format!(
        "participants.guidance.run={{ fmu = {:?} }}",
        text(&escapement_tests::program::root().join("tests/fmus/reference/fmi2/Dahlquist.fmu"))
    );
    let cases: [(&[&str], Vec<String>, &str); 5] = [
        (
            &["--participant", "nobody"],
            vec![],
            "it has `controller`, `guidance`, `plant`",
        ),
        (
            &["--participant", "guidance"],
            vec![external.clone()],
            "a program of its own",
        ),
        (&["--participant", "guidance"], vec![fmu], "is an FMU already"),
        (&[], vec![external], "a program of its own"),
        (&["--inputs", "plant.command"], vec![], "is fed by `controller.command`"),
    ];
    for (more, sets, expected) in cases {
        let more = [more, &["--out", text(&out)]].concat();
        let output = export(CLOSE, &more, &sets);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(expected), "no `{expected}` in {output:?}");
        assert!(!out.exists());
    }
    let missing: PathBuf = folder.path().join("libnone.so");
    let output = export(CLOSE, &["--participant", "plant", "--library", text(&missing)], &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("libnone.so"), "{output:?}");
}
