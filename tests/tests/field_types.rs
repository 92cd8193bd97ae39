//! Truth values, enumerations and small numbers as signals: an example in Rust and C++, and one in C that shares nothing with it.

use std::path::Path;

use escapement_tests::compiler::{Workshop, examples, library};
use escapement_tests::program::{Folder, Said, built, call, orchestrate, root, text};

const TANK: &str = "examples/tank/tank.toml";
const CROSSING: &str = "examples/c/crossing.toml";

fn tank(arguments: &[&str]) -> Said {
    call(&built().join("tank"), arguments)
}

/// What is written of a refusal of the tank's scenario with one change.
fn refused(set: &str) -> String {
    let said = tank(&["check", TANK, "--set", set]);
    assert_eq!(said.code, Some(2), "{set}: {said:?}");
    said.err
}

/// One tape from processes, from one loop, and taken up in the middle, in either way.
fn one_tape(folder: &Folder, run: &dyn Fn(&[&str]) -> Said) {
    let path = |name: &str| folder.path().join(name);
    let done = |said: Said| assert_eq!(said.code, Some(0), "{said:?}");
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
        done(orchestrate(&arguments));
    }
    for name in ["within", "again", "again-within"] {
        let said = orchestrate(&["compare", text(&first), text(&path(name))]);
        assert_eq!(said.code, Some(0), "{name}: {said:?}");
    }
}

#[test]
fn named_values_of_rust_and_cpp_give_one_tape() {
    let folder = Folder::new("tank");
    let run = |arguments: &[&str]| tank(&[&[arguments[0], TANK, "--quiet"], &arguments[1..]].concat());
    let (first, cpp) = (folder.path().join("processes"), folder.path().join("cpp"));
    let said = run(&["run", "--out", text(&first), "--checkpoint-every", "17s"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let within = folder.path().join("within");
    let said = run(&["run", "--out", text(&within), "--in-process"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let set = library("operator", &examples().path("cpp/liboperator.so"), None);
    let said = run(&["run", "--out", text(&cpp), "--set", &set]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let again = folder.path().join("again");
    let said = tank(&[
        "resume",
        text(&first),
        "--from",
        "34s",
        "--quiet",
        "--out",
        text(&again),
    ]);
    assert_eq!(said.code, Some(0), "{said:?}");
    for other in [&within, &cpp, &again] {
        let said = orchestrate(&["compare", text(&first), text(other)]);
        assert_eq!(said.code, Some(0), "{}: {said:?}", other.display());
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
        library("light", &file, Some("light")),
        library("crowd", &file, Some("crowd")),
    ];
    one_tape(&folder, &|arguments| {
        let mut all = vec![arguments[0], CROSSING, "--quiet"];
        sets.iter().for_each(|set| all.extend(["--set", set]));
        all.extend(&arguments[1..]);
        orchestrate(&all)
    });
    let said = orchestrate(&["export", text(&folder.path().join("within")), "--to", "csv"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let table = walk(folder.path(), "light.signal.csv");
    assert!(
        table.starts_with("t [s],phase,walk,left [s]\n0.0,green,0,0\n"),
        "{table}"
    );
    assert!(table.contains(",red and amber,0,1\n"), "{table}");
}

/// The text of the file `name` somewhere below `folder`.
fn walk(folder: &Path, name: &str) -> String {
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
fn byte_without_a_meaning_ends_the_run_with_field_and_value() {
    let folder = Folder::new("spoilt");
    let source = |name: &str, from: &str, to: &str| {
        let good = std::fs::read_to_string(root().join("examples/cpp/operator.cpp")).unwrap();
        assert!(good.contains(from));
        folder.write(name, &good.replace(from, to))
    };
    let shop = Workshop::open("spoilt");
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
        let plugin = shop.plugin(text(&file), &format!("lib{name}.so"), &[]);
        for how in [&[][..], &["--in-process"]] {
            let out = folder.path().join(format!("{name}{}", how.len()));
            let set = library("operator", &plugin, None);
            let arguments = [&["run", TANK, "--quiet", "--set", &set, "--out", text(&out)], how].concat();
            let said = tank(&arguments);
            assert_eq!(said.code, Some(1), "{said:?}");
            for part in ["`operator`", "t = 3 s", words] {
                assert!(said.err.contains(part), "{part}: {said:?}");
            }
        }
    }
}

#[test]
fn what_makes_no_sense_of_names_is_refused() {
    for (set, words) in [
        (
            "connections.order.initial={ valve = \"Opened\" }",
            "`\"Opened\"` is none of its values: write \"Closed\", \"Filling\", \"Draining\"",
        ),
        (
            "connections.order.initial={ seen_full = 2 }",
            "`2` is no truth value: write true or false",
        ),
        (
            "faults=[{ at = \"1 s\", output = \"tank.gauge\", field = \"full\", kind = \"bias\", value = 1 }]",
            "a bias changes numbers, and `full: bool` has a bool or an enumeration",
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
        let said = refused(set);
        assert!(said.contains(words), "{set}: {said}");
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
    let said = run("stuck", &[stuck, dry]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("outside of 0 to 2 m"), "{said:?}");

    let never = "guards.g={ output = \"operator.order\", field = \"valve\", never = [\"Draining\"] }";
    let said = run("never", &[never]);
    assert_eq!(said.code, Some(1), "{said:?}");
    let words = "with valve = Draining, which must never be (guard `g`)";
    assert!(said.err.contains(words), "{said:?}");

    // The same enumeration by fields, and a truth value that always holds.
    let map = "connections.order.map={ valve = \"valve\", seen_full = true }";
    let said = run("mapped", &[map]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let plain = run("plain", &[]);
    assert_eq!(plain.code, Some(0), "{plain:?}");
    let level = |name: &str| std::fs::read(folder.path().join(name).join("tape/tank.gauge.bin")).unwrap();
    assert_eq!(level("mapped"), level("plain"));
}
