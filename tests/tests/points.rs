//! Points of a campaign: repeated alone, kept, sufficient in number, and extended.

use std::path::Path;

use escapement_tests::fixture::write_oscillator;
use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use serde_json::Value;

const CLOSE: [&str; 4] = ["sweep", "scenarios/close.toml", "--duration", "500 ms"];
const DELAYS: [&str; 2] = ["--vary", "connections.measured.delay=0ms..20ms:10ms"];

fn close(out: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&CLOSE[..], &["--out", text(out)], more].concat())
}

fn summary(run: &Path) -> Value {
    let text = std::fs::read(run.join("summary.json")).unwrap_or_else(|error| panic!("{}: {error}", run.display()));
    serde_json::from_slice(&text).expect("a summary is JSON")
}

/// The names in a folder of run folders.
fn runs(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(out.join("runs")).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn point_rerun_alone_has_the_same_digest() {
    let folder = Folder::new("point");
    let out = |name: &str| folder.path().join(name);
    let rows = close(&out("sweep"), &[&DELAYS[..], &["--json", "--digest"]].concat()).json()["rows"].clone();
    // Another system, whose participants are separate programs.
    let scenario = write_oscillator(&folder, "damper");
    let other = out("other");
    let arguments = [
        "sweep",
        text(&scenario),
        "--vary",
        "participants.damper.period=10ms,20ms",
        "--json",
        "--digest",
        "--out",
        text(&other),
    ];
    let others = run_orchestrator(&arguments).json()["rows"].clone();
    for (place, row) in [("sweep:2", &rows[1]), ("sweep:3", &rows[2]), ("other:2", &others[1])] {
        let run = out(&format!("run-{}", place.replace(':', "-")));
        let place = out(place);
        let output = run_orchestrator(&["run", "--point", text(&place), "--quiet", "--out", text(&run)]);
        assert!(
            matches!(output.code, Some(0 | 3)) && output.err.is_empty(),
            "{output:?}"
        );
        assert_eq!(summary(&run)["tape_digest"], row["tape_digest"]);
        assert!(run.join("tape/index.json").is_file());
    }
    // With a change it is a different run, and nothing is compared.
    let run = out("changed");
    let output = run_orchestrator(&[
        "run",
        "--point",
        text(&out("sweep:2")),
        "--seed",
        "7",
        "--quiet",
        "--out",
        text(&run),
    ]);
    assert!(output.err.is_empty(), "{output:?}");

    // If the scenario has changed since then, the tape differs, and the message states why.
    let stock = std::fs::read_to_string(&scenario).unwrap();
    std::fs::write(&scenario, stock.replace("10 s", "9 s")).unwrap();
    let run = out("later");
    let output = run_orchestrator(&["run", "--point", text(&out("other:1")), "--quiet", "--out", text(&run)]);
    assert_eq!(output.code, Some(3), "{output:?}");
    assert!(
        output.err.contains("has tape ") && output.err.contains("… in the campaign"),
        "{output:?}"
    );
    assert!(
        output.err.contains("the scenario or a file of it is not the same"),
        "{output:?}"
    );

    let sweep = out("sweep");
    let place = |number: &str| format!("{}{number}", sweep.display());
    for (place, part) in [
        (place(":4"), "has no point 4: it has 1 to 3"),
        (place(":0"), "has no point 0"),
        (place(""), "write FOLDER:NUMBER"),
        (place(":x"), "write FOLDER:NUMBER"),
        (format!("{}:1", root().join("docs").display()), "no campaign.json"),
    ] {
        let output = run_orchestrator(&["run", "--point", &place]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
}

#[test]
fn requested_run_folders_are_kept() {
    let folder = Folder::new("kept");
    let out = folder.path().join("sweep");
    let output = close(
        &out,
        &[
            &DELAYS[..],
            &["--json", "--keep", "worst:1", "--figure", "peak_base_torque"],
        ]
        .concat(),
    );
    let rows = output.json()["rows"].as_array().expect("rows").clone();
    let torque = |row: &Value| {
        let figures = row["figures"].as_object().expect("figures");
        let own = figures.iter().find(|(key, _)| key.starts_with("peak_base_torque"));
        own.and_then(|(_, value)| value.as_f64())
    };
    // Of several equal ones the first.
    let worst = (0..3)
        .rev()
        .max_by(|a, b| torque(&rows[*a]).unwrap().total_cmp(&torque(&rows[*b]).unwrap()));
    assert_eq!(runs(&out), [format!("{:05}", worst.unwrap() + 1)]);
    let run = out.join("runs").join(&runs(&out)[0]);
    assert!(summary(&run)["tape_digest"].is_string() && rows[worst.unwrap()]["tape_digest"].is_null());
    // More points are kept later, and only those are run again.
    let lines = std::fs::read(out.join("results.jsonl")).unwrap();
    let output = close(&out, &[&DELAYS[..], &["--quiet", "--keep"]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(runs(&out), ["00001", "00002", "00003"]);
    assert_eq!(std::fs::read(out.join("results.jsonl")).unwrap(), lines);

    // Failed points, of another system.
    let scenario = write_oscillator(&folder, "damper");
    let exe = |name: &str| {
        format!(
            "{{ exe = \"{}\" }}",
            escapement_tests::program::participant(name).display()
        )
    };
    let vary = format!("participants.damper.run={},{}", exe("damper"), exe("crash_at"));
    let out = folder.path().join("failed");
    let output = run_orchestrator(&[
        "sweep",
        text(&scenario),
        "--vary",
        &vary,
        "--keep",
        "failed",
        "--quiet",
        "--out",
        text(&out),
    ]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert_eq!(runs(&out), ["00002"]);
    assert!(out.join("runs/00002/log").is_dir());

    for (more, part) in [
        (&["--keep", "best:3"][..], "worst:10"),
        (&["--keep", "worst:3", "--shard", "1/2"], "sweep merge"),
    ] {
        let output = close(&folder.path().join("no"), &[&DELAYS[..], more].concat());
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(part), "{output:?}");
    }
}

#[test]
fn campaign_ends_when_its_stopping_rule_holds() {
    let folder = Folder::new("until");
    let out = |name: &str| folder.path().join(name);
    let run = |name: &str, workers: &str, more: &[&str]| {
        let own = ["--seeds", "40", "--quiet", "--workers", workers];
        close(&out(name), &[&own[..], more].concat())
    };
    let table = |name: &str| std::fs::read_to_string(out(name).join("table.csv")).unwrap();
    let points = |name: &str| table(name).lines().count() - 1;
    let until = ["--until", "met within 12 %"];
    assert_eq!(run("one", "1", &until).code, Some(0));
    let first = (points("one"), table("one"));
    // None of n is met: the interval's half width is z² / 2 (n + z²), which is 12 % from n = 13 on.
    assert_eq!(first.0, 13);
    // Several workers are some points ahead: the table ends at the same point.
    run("three", "3", &until);
    assert_eq!(table("three"), first.1);
    // Without an end the remaining points are run, and the existing ones are not run again.
    run("one", "2", &[]);
    assert_eq!(points("one"), 40);
    let journal = std::fs::read_to_string(out("one/results.jsonl")).unwrap();
    assert_eq!(journal.lines().count(), 40, "nothing was run twice");
    run("one", "2", &until);
    assert_eq!(table("one"), first.1);
    for (until, part) in [
        ("met", "`met within 1 %`"),
        ("beauty within 1 %", "`beauty`"),
        ("met within 0 %", "no width"),
    ] {
        let output = run("no", "1", &["--until", until]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(part), "{output:?}");
    }
}

#[test]
fn extended_campaign_runs_only_new_points() {
    let folder = Folder::new("grows");
    let out = |name: &str| folder.path().join(name);
    let seeds = |name: &str, count: &str| close(&out(name), &["--seeds", count, "--json"]);
    assert_eq!(seeds("grown", "4").json()["points"], 4);
    let four = std::fs::read_to_string(out("grown/results.jsonl")).unwrap();
    assert_eq!(seeds("grown", "9").json()["points"], 9);
    let nine = std::fs::read_to_string(out("grown/results.jsonl")).unwrap();
    assert!(nine.starts_with(&four), "what was there stays");
    assert_eq!(nine.lines().count(), 9, "nothing was run twice");
    seeds("at-once", "9");
    for file in ["table.csv", "table.parquet", "figure.svg"] {
        let read = |name: &str| std::fs::read(out(name).join(file)).unwrap();
        assert!(read("grown") == read("at-once"), "{file}");
    }
    let output = seeds("grown", "4");
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("has 9 points and not 4") && output.err.contains("--out"),
        "{output:?}"
    );
    // A grid whose first points differ is not an extension.
    let output = close(&out("grown"), &["--vary", "seed=2..20"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("the points are not the same"), "{output:?}");
}
