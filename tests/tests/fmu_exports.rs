//! FMUs that the program makes: in the place of what they were made of they give the same tape.

use std::path::{Path, PathBuf};

use escapement_tests::compiler::{examples, library};
use escapement_tests::program::{Folder, Said, built, orchestrate, text};

const CLOSE: &str = "scenarios/close.toml";
const PID: &str = "examples/pid/pid.toml";

fn run(scenario: &str, out: &Path, sets: &[String], more: &[&str]) {
    let mut arguments = vec!["run", scenario, "--quiet", "--out", text(out)];
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    arguments.extend(more);
    let said = orchestrate(&arguments);
    assert!(matches!(said.code, Some(0 | 3)), "{sets:?} {more:?}: {said:?}");
}

fn same(one: &Path, other: &Path) {
    let said = orchestrate(&["compare", text(one), text(other)]);
    assert_eq!(said.code, Some(0), "{}: {said:?}", other.display());
}

fn export(scenario: &str, more: &[&str], sets: &[String]) -> Said {
    let mut arguments = vec!["fmu", "export", scenario];
    arguments.extend(more);
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    orchestrate(&arguments)
}

/// Exports a participant, and gives the changes that put the FMU in its place, which the program has printed.
fn in_its_place(folder: &Folder, scenario: &str, name: &str, fmi: &str, sets: &[String]) -> Vec<String> {
    let file = folder.path().join(format!("{name}-{fmi}.fmu"));
    let said = export(
        scenario,
        &["--participant", name, "--fmi", fmi, "--out", text(&file)],
        sets,
    );
    assert_eq!(said.code, Some(0), "{said:?}");
    let (_, entry) = said
        .out
        .split_once("In the place of the participant:\n")
        .expect("the entry is printed");
    let entry: toml::Table = entry.parse().unwrap_or_else(|error| panic!("{entry}: {error}"));
    let own = entry["participants"][name].as_table().expect("an entry");
    vec![
        format!("participants.{name}.run={}", own["run"]),
        format!("participants.{name}.parameters={{}}"),
    ]
}

/// An FMU in the place of each of `names`, then of all of them, in processes and in one: `reference` is the tape.
fn changes_no_bit(folder: &Folder, scenario: &str, sets: &[String], names: &[&str], more: &[&str]) {
    let path = |name: &str| folder.path().join(name);
    run(scenario, &path("reference"), sets, more);
    for fmi in ["2", "3"] {
        let mut all = sets.to_vec();
        for name in names {
            let own = in_its_place(folder, scenario, name, fmi, sets);
            let out = path(&format!("{name}-{fmi}"));
            run(
                scenario,
                &out,
                &[sets, &own].concat(),
                &[more, &["--in-process"]].concat(),
            );
            same(&path("reference"), &out);
            all.extend(own);
        }
        let out = path(&format!("all-{fmi}"));
        run(scenario, &out, &all, more);
        same(&path("reference"), &out);
        let resumed = path(&format!("resumed-{fmi}"));
        let saved = path(&format!("saved-{fmi}"));
        run(
            scenario,
            &saved,
            &all,
            &[more, &["--in-process", "--checkpoint-at", "0.7 s"]].concat(),
        );
        let said = orchestrate(&[
            "resume",
            text(&saved),
            "--out",
            text(&resumed),
            "--quiet",
            "--in-process",
        ]);
        assert!(matches!(said.code, Some(0 | 3)), "{said:?}");
        same(&path("reference"), &resumed);
    }
}

#[test]
fn capture_of_fmus_is_the_same_run() {
    let folder = Folder::new("exported-close");
    let more = ["--duration", "1.5 s"];
    changes_no_bit(&folder, CLOSE, &[], &["plant", "controller", "guidance"], &more);
}

/// A plug-in goes into its FMU, in another language than the stock participants and with a delay on the way.
#[test]
fn position_loop_of_fmus_of_plugins_is_the_same_run() {
    let folder = Folder::new("exported-pid");
    let shop = examples();
    let loops = [("plant", "plant"), ("controller", "pid"), ("reference", "reference")];
    let sets: Vec<String> = loops
        .iter()
        .map(|(seat, name)| library(seat, &shop.path(&format!("c/lib{name}.so")), None))
        .collect();
    changes_no_bit(&folder, PID, &sets, &["plant", "controller", "reference"], &[]);
}

/// The FMU is the same bytes again, and says of itself what `inspect` understands.
#[test]
fn export_is_reproducible_and_can_be_inspected() {
    let folder = Folder::new("exported-twice");
    for fmi in ["2", "3"] {
        let file = |name: &str| folder.path().join(format!("{name}-{fmi}.fmu"));
        for name in ["one", "other"] {
            let out = file(name);
            let said = export(
                CLOSE,
                &["--participant", "plant", "--fmi", fmi, "--out", text(&out)],
                &[],
            );
            assert_eq!(said.code, Some(0), "{said:?}");
        }
        let bytes = |name: &str| std::fs::read(file(name)).expect("the FMU is there");
        assert!(bytes("one") == bytes("other"), "FMI {fmi}");
        let said = orchestrate(&["fmu", "inspect", text(&file("one"))]);
        assert_eq!(said.code, Some(0), "{said:?}");
        for word in ["parameters.start.position", "rad/s", "measured."] {
            assert!(said.out.contains(word), "no `{word}` in {}", said.out);
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
            "\"parameters.start.position[0]\" = \"-50 cm\", \"parameters.start.position[2]\" = -2.5",
        ),
        ("3", "\"parameters.start.position\" = [-0.5, 0.0, -2.5]"),
    ] {
        let own = in_its_place(&folder, CLOSE, "plant", fmi, &[]);
        let sets = vec![
            own[0].clone(),
            format!("participants.plant.parameters={{ {parameters} }}"),
        ];
        run(CLOSE, &path(fmi), &sets, &more);
        same(&path("reference"), &path(fmi));
    }
}

#[test]
fn step_that_is_no_multiple_of_the_period_is_refused() {
    let folder = Folder::new("exported-step");
    for (fmi, how) in [("2", "Discard"), ("3", "whole multiple")] {
        let own = in_its_place(&folder, CLOSE, "controller", fmi, &[]);
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
        let said = orchestrate(&arguments);
        assert!(matches!(said.code, Some(1 | 2)), "{said:?}");
        assert!(said.err.contains(how), "{said:?}");
        assert!(said.err.contains("0.01 s"), "{said:?}");
    }
}

/// What cannot be exported is refused with the reason, and leaves no file.
#[test]
fn what_cannot_be_exported_is_refused() {
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
        let said = export(CLOSE, &more, &sets);
        assert_eq!(said.code, Some(2), "{said:?}");
        assert!(said.err.contains(expected), "no `{expected}` in {said:?}");
        assert!(!out.exists());
    }
    let missing: PathBuf = folder.path().join("libnone.so");
    let said = export(CLOSE, &["--participant", "plant", "--library", text(&missing)], &[]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("libnone.so"), "{said:?}");
}
