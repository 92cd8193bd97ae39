//! Truth values, enumerations and small numbers as signals: an example in Rust and C++, and one in C that is independent of it.

use std::path::Path;

use escapement_tests::compiler::{NativeBuild, examples, library_override};
use escapement_tests::program::{Folder, ProgramOutput, built, root, run_orchestrator, run_program, text};

const TANK: &str = "examples/tank/tank.toml";
const CROSSING: &str = "examples/c/crossing.toml";
const BEACON: &str = "examples/c/beacon.toml";

/// The changes that name the plug-in of the beacon.
fn beacon_sets() -> [String; 2] {
    let file = examples().path("c/libbeacon.so");
    ["beacon", "station"].map(|name| library_override(name, &file, Some(name)))
}

/// A command for the beacon's scenario.
fn beacon(command: &str, more: &[&str]) -> ProgramOutput {
    let sets = beacon_sets();
    let mut all = vec![command, BEACON];
    sets.iter().for_each(|set| all.extend(["--set", set]));
    all.extend(more);
    run_orchestrator(&all)
}

fn tank(arguments: &[&str]) -> ProgramOutput {
    run_program(&built().join("tank"), arguments)
}

/// The error message of the tank's scenario with one change.
fn check_refusal(set: &str) -> String {
    let output = tank(&["check", TANK, "--set", set]);
    assert_eq!(output.code, Some(2), "{set}: {output:?}");
    output.err
}

/// Checks that the tape is the same from processes, from one loop, and resumed in the middle, in either way.
fn assert_one_tape(folder: &Folder, run: &dyn Fn(&[&str]) -> ProgramOutput) {
    let path = |name: &str| folder.path().join(name);
    let done = |output: ProgramOutput| assert_eq!(output.code, Some(0), "{output:?}");
    let (first, within) = (path("processes"), path("within"));
    done(run(&["run", "--out", text(&first), "--checkpoint-every", "17s"]));
    done(run(&[
        "run",
        "--out",
        text(&within),
        "--checkpoint-every",
        "17s",
        "--in-process",
    ]));
    for (from, to, how) in [(&first, "again", &[][..]), (&within, "again-within", &["--in-process"])] {
        let to = path(to);
        let mut arguments = vec!["resume", text(from), "--from", "34s", "--quiet", "--out", text(&to)];
        arguments.extend(how);
        done(run_orchestrator(&arguments));
    }
    for name in ["within", "again", "again-within"] {
        let output = run_orchestrator(&["compare", text(&first), text(&path(name))]);
        assert_eq!(output.code, Some(0), "{name}: {output:?}");
    }
}

#[test]
fn named_values_of_rust_and_cpp_give_one_tape() {
    let folder = Folder::new("tank");
    let run = |arguments: &[&str]| tank(&[&[arguments[0], TANK, "--quiet"], &arguments[1..]].concat());
    let (first, cpp) = (folder.path().join("processes"), folder.path().join("cpp"));
    let output = run(&["run", "--out", text(&first), "--checkpoint-every", "17s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let within = folder.path().join("within");
    let output = run(&["run", "--out", text(&within), "--in-process"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let set = library_override("operator", &examples().path("cpp/liboperator.so"), None);
    let output = run(&["run", "--out", text(&cpp), "--set", &set]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let again = folder.path().join("again");
    let output = tank(&[
        "resume",
        text(&first),
        "--from",
        "34s",
        "--quiet",
        "--out",
        text(&again),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    for other in [&within, &cpp, &again] {
        let output = run_orchestrator(&["compare", text(&first), text(other)]);
        assert_eq!(output.code, Some(0), "{}: {output:?}", other.display());
    }
    let figures = tank(&[
        "run",
        TANK,
        "--json",
        "--in-process",
        "--out",
        text(&folder.path().join("json")),
    ])
    .json();
    // Filled, drained, filled and drained again.
    assert_eq!(figures["measures"]["moves"]["value"], 3.0, "{figures}");
}

#[test]
fn named_values_of_c_give_one_tape() {
    let folder = Folder::new("crossing");
    let file = examples().path("c/libcrossing.so");
    let sets = [
        library_override("light", &file, Some("light")),
        library_override("crowd", &file, Some("crowd")),
    ];
    assert_one_tape(&folder, &|arguments| {
        let mut all = vec![arguments[0], CROSSING, "--quiet"];
        sets.iter().for_each(|set| all.extend(["--set", set]));
        all.extend(&arguments[1..]);
        run_orchestrator(&all)
    });
    let output = run_orchestrator(&["export", text(&folder.path().join("within")), "--to", "csv"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let table = read_file_below(folder.path(), "light.signal.csv");
    assert!(
        table.starts_with("t [s],phase,walk,left [s]\n0.0,green,0,0\n"),
        "{table}"
    );
    assert!(table.contains(",red and amber,0,1\n"), "{table}");
}

#[test]
fn texts_and_bytes_give_one_tape_and_are_exported() {
    let folder = Folder::new("beacon");
    assert_one_tape(&folder, &|arguments| {
        beacon(arguments[0], &[&["--quiet"], &arguments[1..]].concat())
    });
    let out = folder.path().join("within");
    let output = run_orchestrator(&["export", text(&out), "--to", "csv"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let table = read_file_below(folder.path(), "beacon.beacon.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert!(
        lines[0].starts_with("t [s],count [1],frame,phase,state"),
        "{}",
        lines[0]
    );
    assert_eq!(lines[1], "0.0,0,,wartet – idle,idle");
    // The first frame has the first byte of the answer, `<`.
    assert_eq!(lines[4], "1.5,1,3c,sending,sending");
    assert!(table.contains(",\"fault, \"\"again\"\"\",fault"), "{table}");
    let summary = std::fs::read_to_string(out.join("summary.json")).expect("the run has a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["measures"]["words"]["value"], 59.0, "{summary}");
    for format in ["parquet", "mat", "mcap"] {
        let output = run_orchestrator(&["export", text(&out), "--to", format]);
        assert_eq!(output.code, Some(0), "{format}: {output:?}");
    }
    let output = run_orchestrator(&["report", text(&out)]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn invalid_text_from_a_foreign_program_ends_the_run() {
    let folder = Folder::new("garbled");
    let good = std::fs::read_to_string(root().join("examples/c/beacon.c")).unwrap();
    let last = "    memcpy(outputs[0], beacon, sizeof *beacon);\n";
    assert!(good.contains(last));
    let native_build = NativeBuild::new("garbled");
    let words = "its output `beacon` has ";
    for (name, line, reason) in [
        (
            "utf",
            "beacon->phase[2] = (char)0xff;",
            "phase: it is not UTF-8 from byte 2 on",
        ),
        (
            "rest",
            "beacon->phase[20] = 'x';",
            "phase: the text ends at byte 15, and byte 20 behind it is not zero",
        ),
        (
            "length",
            "beacon->frame.length = 300;",
            "frame: its length is 300, and it has room for 32 bytes",
        ),
        (
            "behind",
            "beacon->frame.data[9] = 1;",
            "frame: bytes behind its 0 bytes are not zero",
        ),
    ] {
        let spoilt = good.replace(last, &format!("    if (step->index == 6) {line}\n{last}"));
        let file = folder.write(&format!("{name}.c"), &spoilt);
        let plugin = native_build.plugin(text(&file), &format!("lib{name}.so"), &[]);
        let set = library_override("beacon", &plugin, Some("beacon"));
        for how in [&[][..], &["--in-process"]] {
            let out = folder.path().join(format!("{name}{}", how.len()));
            let output = beacon("run", &[&["--quiet", "--set", &set, "--out", text(&out)], how].concat());
            assert_eq!(output.code, Some(1), "{output:?}");
            for part in ["`beacon`", "t = 3 s", words, reason] {
                assert!(output.err.contains(part), "{part}: {output:?}");
            }
        }
    }
}

#[test]
fn invalid_use_of_a_text_field_is_refused() {
    let two = "connections.beacon={ from = \"beacon.beacon\", to = \"station.beacon\", map = ";
    let rest = "count = \"count\", frame = \"frame\", state = \"state\" } }";
    let map = |phase: &str| format!("{two}{{ phase = {phase}, {rest}");
    for (set, words) in [
        (map("\"count\""), "text[24] does not hold every value of u32"),
        (map("\"frame\""), "text[24] does not hold every value of bytes[32]"),
        (
            map("{ from = \"phase\", factor = 2.0 }"),
            "is made of values that are taken over as they are",
        ),
        (map("{ value = \"always\" }"), "has no constant"),
        (
            "connections.beacon.initial={ phase = \"longer than the room that there is\" }".into(),
            "34 bytes do not fit into 24",
        ),
        (
            "connections.beacon.initial={ frame = \"0g\" }".into(),
            "write them in hexadecimal",
        ),
        ("connections.beacon.initial={ phase = 3 }".into(), "`3` is not a text"),
        (
            "guards.alive.never=\"idle\"".into(),
            "has neither a range nor named values: it can be guarded with `frozen-for` alone",
        ),
        (
            "measures.words.compute=\"mean\"".into(),
            "ask for compute = \"changes\"",
        ),
        (
            "measures.words.compute=\"final\"".into(),
            "ask for compute = \"changes\"",
        ),
        (
            "faults=[{ at = \"1 s\", output = \"beacon.beacon\", field = \"phase\", kind = \"noise\", value = 1 }]"
                .into(),
            "can be stuck or drop out",
        ),
        (
            "faults=[{ at = \"1 s\", output = \"beacon.beacon\", field = \"phase\", kind = \"stuck\", value = \"x\" }]"
                .into(),
            "leave the value out",
        ),
        (
            "report={ panels = [{ title = \"x\", curves = [\"beacon.beacon.phase\"] }] }".into(),
            "has no place on an axis",
        ),
    ] {
        let output = beacon("check", &["--set", &set]);
        assert_eq!(output.code, Some(2), "{set}: {output:?}");
        assert!(output.err.contains(words), "{set}: {output:?}");
    }
}

#[test]
fn texts_are_stuck_guarded_and_mapped() {
    let folder = Folder::new("text-uses");
    let run = |name: &str, sets: &[&str]| {
        let out = folder.path().join(name);
        let mut more = vec!["--quiet", "--in-process", "--out", text(&out)];
        sets.iter().for_each(|set| more.extend(["--set", *set]));
        beacon("run", &more)
    };
    let stuck = "faults=[{ at = \"10 s\", output = \"beacon.beacon\", field = \"phase\", kind = \"stuck\" }]";
    let output = run(
        "stuck",
        &[
            stuck,
            "guards.g={ output = \"station.station\", field = \"answer\", frozen-for = \"5 s\" }",
        ],
    );
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("frozen: answer = \"<"), "{output:?}");
    let map = "connections.beacon.map={ count = \"count\", frame = \"frame\", phase = \"phase\", state = \"state\" }";
    for (name, sets) in [("plain", &[][..]), ("mapped", &[map])] {
        let output = run(name, sets);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    let tape = |name: &str| std::fs::read(folder.path().join(name).join("tape/station.station.bin")).unwrap();
    assert_eq!(tape("mapped"), tape("plain"));
}

/// The text of the file `name` somewhere below `folder`.
fn read_file_below(folder: &Path, name: &str) -> String {
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("it can be read").map(Result::unwrap) {
            match entry.path() {
                path if path.is_dir() => folders.push(path),
                path if path.ends_with(name) => return std::fs::read_to_string(path).expect("it is a text"),
                _ => {}
            }
        }
    }
    panic!("there is no {name}");
}

#[test]
fn undefined_enumeration_value_ends_run_with_field_and_value() {
    let folder = Folder::new("spoilt");
    let source = |name: &str, from: &str, to: &str| {
        let good = std::fs::read_to_string(root().join("examples/cpp/operator.cpp")).unwrap();
        assert!(good.contains(from));
        folder.write(name, &good.replace(from, to))
    };
    let native_build = NativeBuild::new("spoilt");
    let last = "        *output = order;\n";
    for (name, line, words) in [
        (
            "valve",
            "if (step.index == 30) *reinterpret_cast<unsigned char *>(&output->valve) = 7;\n",
            "its output `order` has valve = 7: its values are Closed (0), Filling (1), Draining (2)",
        ),
        (
            "truth",
            "if (step.index == 30) *reinterpret_cast<unsigned char *>(&output->seen_full) = 2;\n",
            "its output `order` has seen_full = 2: a bool is 0 or 1",
        ),
    ] {
        let file = source(&format!("{name}.cpp"), last, &format!("{last}{line}"));
        let spoilt = std::fs::read_to_string(&file).unwrap();
        let spoilt = spoilt.replace("const escapement::Step &)", "const escapement::Step &step)");
        std::fs::write(&file, spoilt).unwrap();
        let plugin = native_build.plugin(text(&file), &format!("lib{name}.so"), &[]);
        for how in [&[][..], &["--in-process"]] {
            let out = folder.path().join(format!("{name}{}", how.len()));
            let set = library_override("operator", &plugin, None);
            let arguments = [&["run", TANK, "--quiet", "--set", &set, "--out", text(&out)], how].concat();
            let output = tank(&arguments);
            assert_eq!(output.code, Some(1), "{output:?}");
            for part in ["`operator`", "t = 3 s", words] {
                assert!(output.err.contains(part), "{part}: {output:?}");
            }
        }
    }
}

#[test]
fn invalid_use_of_an_enumeration_field_is_refused() {
    for (set, words) in [
        (
            "connections.order.initial={ valve = \"Opened\" }",
            "`\"Opened\"` is none of its values: write \"Closed\", \"Filling\", \"Draining\"",
        ),
        (
            "connections.order.initial={ seen_full = 2 }",
            "`2` is not a truth value: write true or false",
        ),
        (
            "faults=[{ at = \"1 s\", output = \"tank.gauge\", field = \"full\", kind = \"bias\", value = 1 }]",
            "a bias changes numbers, and `full: bool` has a bool, an enumeration, a text or bytes",
        ),
        (
            "faults=[{ at = \"1 s\", output = \"operator.order\", field = \"valve\", kind = \"stuck\", value = \"Broken\" }]",
            "`\"Broken\"` is none of its values",
        ),
        (
            "connections.order={ from = \"operator.order\", to = \"tank.order\", map = { valve = \"seen_full\" } }",
            "enum does not hold every value of bool",
        ),
        (
            "guards.g={ output = \"operator.order\", field = \"valve\", range = [0, 1] }",
            "has no range: name the values that it must not have",
        ),
        (
            "guards.g={ output = \"operator.order\", field = \"valve\", never = \"Broken\" }",
            "`\"Broken\"` is none of its values",
        ),
        (
            "measures.m={ of = \"operator.order.valve\", compute = \"mean\" }",
            "with which nothing can be computed: ask for one of its values, such as is = \"Closed\"",
        ),
        (
            "measures.m={ of = \"tank.gauge.level\", is = \"Closed\", compute = \"mean\" }",
            "asks for a value of an enumeration",
        ),
    ] {
        let output = check_refusal(set);
        assert!(output.contains(words), "{set}: {output}");
    }
}

#[test]
fn names_are_stuck_guarded_and_mapped() {
    let folder = Folder::new("uses");
    let run = |name: &str, sets: &[&str]| {
        let out = folder.path().join(name);
        let mut arguments = vec!["run", TANK, "--quiet", "--in-process", "--out", text(&out)];
        sets.iter().for_each(|set| arguments.extend(["--set", *set]));
        tank(&arguments)
    };
    // The valve sticks: the tank overflows, and the operator does not know.
    let stuck = "faults=[{ at = \"3 s\", output = \"operator.order\", field = \"valve\", kind = \"stuck\", value = \"Filling\" }]";
    let dry = "guards.g={ output = \"tank.gauge\", field = \"level\", range = \"[0, 2] m\" }";
    let output = run("stuck", &[stuck, dry]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("outside of 0 to 2 m"), "{output:?}");

    let never = "guards.g={ output = \"operator.order\", field = \"valve\", never = [\"Draining\"] }";
    let output = run("never", &[never]);
    assert_eq!(output.code, Some(1), "{output:?}");
    let words = "with valve = Draining, which must never be (guard `g`)";
    assert!(output.err.contains(words), "{output:?}");

    // The same enumeration by fields, and a truth value that always holds.
    let map = "connections.order.map={ valve = \"valve\", seen_full = true }";
    let output = run("mapped", &[map]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let plain = run("plain", &[]);
    assert_eq!(plain.code, Some(0), "{plain:?}");
    let level = |name: &str| std::fs::read(folder.path().join(name).join("tape/tank.gauge.bin")).unwrap();
    assert_eq!(level("mapped"), level("plain"));
}
