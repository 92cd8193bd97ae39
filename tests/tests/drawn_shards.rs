//! Campaign files in shards, in bundles, point by point and extended: the random samples are the same wherever and whenever a point is run.

use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use escapement_tests::fixture::write_springs;
use escapement_tests::program::{
    Folder, built_as_shipped, orchestrator, root, run_orchestrator, run_program, start_program, text, wait_for_output,
};

/// Two masses: a Sobol' sequence, masses from a file, and a formula that has no value at some points.
const SPRINGS: &str = r#"
title = "Masses of a list"
scenario = "../springs.toml"
points = 16
design = "sobol"

[vary.mass]
key = "participants.right.parameters.mass"
distribution = "column"
file = "../values/masses.csv"
column = "mass"

[vary.late]
key = "connections.to-right.delay"
distribution = "uniform"
from = "0 ms"
to = "40 ms"
round = "0.1 ms"

[vary.push]
key = "faults.push.value"
distribution = "normal"
mean = "1 mm"
deviation = "0.3 mm"

[vary.part]
distribution = "discrete"
values = [0, 1, 2, 4, 8]

[vary.ratio]
distribution = "formula"
formula = "1 / part"
"#;

/// Writes that campaign with all its files; returns the campaign file.
fn write_campaign(folder: &Folder, campaign: &str) -> PathBuf {
    write_springs(folder);
    for name in ["campaigns", "values"] {
        std::fs::create_dir_all(folder.path().join(name)).unwrap();
    }
    folder.write("values/masses.csv", "mass [kg],name\n0.8,a\n1.0,b\n1.3,c\n");
    folder.write("campaigns/drawn.toml", campaign)
}

/// Table, page, pictures if there is something to draw, and the journal in the order of its points.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let mut files = ["table.csv", "table.parquet", "report.html"].map(read).to_vec();
    files.extend(["figure.svg", "figure.png"].map(|name| std::fs::read(folder.join(name)).unwrap_or_default()));
    let journal = String::from_utf8(read("results.jsonl")).unwrap();
    let number = |line: &&str| serde_json::from_str::<serde_json::Value>(line).unwrap()["point"].as_u64();
    let mut lines: Vec<&str> = journal.lines().collect();
    lines.sort_by_key(number);
    files.push(lines.join("\n").into_bytes());
    files
}

fn assert_same_files(a: &Path, b: &Path) {
    for (number, (a, b)) in files(a).iter().zip(files(b)).enumerate() {
        assert!(*a == b, "file {number} differs");
    }
}

/// Kills the child as soon as the journal in `folder` has a line.
fn kill_during_campaign(mut child: Child, folder: &Path) {
    let begun = Instant::now();
    while std::fs::metadata(folder.join("results.jsonl")).map_or(0, |about| about.len()) == 0 {
        assert!(begun.elapsed().as_secs() < 120, "it never begins");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    wait_for_output(child);
}

#[test]
fn drawn_shards_give_the_table_of_one_machine() {
    let folder = Folder::new("drawn-shards");
    let springs = write_campaign(&folder, SPRINGS);
    let captures = root().join("campaigns/dispersed-captures.toml");
    let captures = [text(&captures), "--points", "12", "--duration", "300 ms"];
    for (number, (campaign, code)) in [(&[text(&springs)][..], 1), (&captures[..], 0)].into_iter().enumerate() {
        let out = |name: &str| folder.path().join(format!("{name}-{number}"));
        let sweep = |name: &str, more: &[&str]| {
            let place = out(name);
            let own = ["--quiet", "--workers", "1", "--out", text(&place)];
            start_program(orchestrator(), &[&["sweep"], campaign, &own[..], more].concat())
        };
        // Second runs are compared by their tapes.
        let output = wait_for_output(sweep("one", &["--digest"]));
        assert_eq!(output.code, Some(code), "{output:?}");
        let shards = ["1/3", "2/3", "3/3"].map(|shard| (shard, out(&shard.replace('/', "-of-"))));
        for (shard, place) in &shards {
            let name = shard.replace('/', "-of-");
            let child = sweep(&name, &["--shard", shard, "--audit", "30%"]);
            if *shard == "2/3" {
                kill_during_campaign(child, place);
                // The missing points are run with only the folder as input.
                let output = run_orchestrator(&["sweep", "run", text(place), "--quiet"]);
                assert!(matches!(output.code, Some(0 | 1)), "{output:?}");
            } else {
                let output = wait_for_output(child);
                assert!(matches!(output.code, Some(0 | 1)), "{output:?}");
            }
        }
        let whole = out("whole");
        let mut merge = vec!["sweep", "merge", text(&whole), "--quiet"];
        merge.extend(shards.iter().map(|(_, place)| text(place)));
        let output = run_orchestrator(&merge);
        assert_eq!(output.code, Some(code), "{output:?}");
        assert_same_files(&whole, &out("one"));
        // The folder contains the campaign of the file: none of it is run again.
        let output = wait_for_output(sweep("whole", &["--digest"]));
        assert_eq!(output.code, Some(code), "{output:?}");
        assert_same_files(&whole, &out("one"));
    }
}

#[test]
fn bundle_has_the_campaign_file_and_its_values() {
    built_as_shipped();
    let folder = Folder::new("drawn-bundle");
    let out = |name: &str| folder.path().join(name);
    let file = write_campaign(&folder, SPRINGS);
    let sweep = |file: &Path, name: &str, more: &[&str]| {
        let place = out(name);
        run_orchestrator(&[&["sweep", text(file), "--quiet", "--out", text(&place)], more].concat())
    };
    sweep(&file, "one", &[]);
    sweep(&file, "more", &["--points", "20"]);
    let output = run_orchestrator(&["sweep", text(&file), "--bundle", text(&out("made"))]);
    assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
    std::fs::rename(out("made"), out("moved")).unwrap();
    for gone in ["campaigns", "values"] {
        std::fs::remove_dir_all(out(gone)).unwrap();
    }
    std::fs::remove_file(out("springs.toml")).unwrap();
    let program = out("moved/bin/escapement");
    let mut merge = vec!["sweep".to_owned(), "merge".into(), text(&out("whole")).into()];
    for number in ["1", "2"] {
        let shard = format!("{number}/2");
        let (bundle, place) = (out("moved"), out(&format!("shard-{number}")));
        let arguments = [
            "sweep",
            "run",
            text(&bundle),
            "--shard",
            &shard,
            "--quiet",
            "--out",
            text(&place),
        ];
        let output = run_program(&program, &arguments);
        assert!(
            matches!(output.code, Some(0 | 1)) && !output.err.contains("error"),
            "{output:?}"
        );
        merge.push(text(&place).to_owned());
    }
    let merge: Vec<&str> = merge.iter().map(String::as_str).collect();
    let output = run_program(&program, &merge);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert_same_files(&out("whole"), &out("one"));
    // The file in the bundle defines the same points, and more of them.
    let inside = out("moved/tree/campaigns/drawn.toml");
    let place = out("whole");
    let arguments = [
        "sweep",
        text(&inside),
        "--points",
        "20",
        "--quiet",
        "--out",
        text(&place),
    ];
    let output = run_program(&program, &arguments);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert_same_files(&out("whole"), &out("more"));
}

#[test]
fn drawn_campaign_grows_where_its_draws_stay() {
    let folder = Folder::new("drawn-grows");
    let out = |name: &str| folder.path().join(name);
    let sweep = |file: &Path, name: &str, more: &[&str]| {
        let place = out(name);
        run_orchestrator(
            &[
                &["sweep", text(file), "--quiet", "--workers", "1", "--out", text(&place)],
                more,
            ]
            .concat(),
        )
    };
    let lines = |name: &str| std::fs::read_to_string(out(name).join("results.jsonl")).unwrap();
    for (design, runs) in [("sobol", 1), ("random", 1), ("saltelli", 5)] {
        let file = write_campaign(&folder, &SPRINGS.replace("\"sobol\"", &format!("\"{design}\"")));
        let (grown, at_once) = (format!("{design}-grown"), format!("{design}-at-once"));
        sweep(&file, &grown, &["--points", "6"]);
        let before = lines(&grown);
        assert_eq!(before.lines().count(), 6 * runs);
        // As stated in the file.
        sweep(&file, &grown, &[]);
        let after = lines(&grown);
        assert_eq!(after.lines().count(), 16 * runs, "nothing was run twice");
        assert!(after.starts_with(&before), "what was there stays");
        sweep(&file, &at_once, &[]);
        assert_same_files(&out(&grown), &out(&at_once));
        let output = sweep(&file, &grown, &["--points", "6"]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output
                .err
                .contains(&format!("has {} points and not {}", 16 * runs, 6 * runs)),
            "{output:?}"
        );
        let file = write_campaign(&folder, &SPRINGS.replace("0.3 mm", "0.4 mm"));
        let output = sweep(&file, &grown, &["--points", "20"]);
        assert!(output.err.contains("the campaign file is not the same"), "{output:?}");
    }
    let assert_refused = |file: &Path, name: &str, more: &[&str], parts: &[&str]| {
        let output = sweep(file, name, more);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert_eq!(output.err.matches("error:").count(), 1, "{output:?}");
        for part in parts {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
    };
    let file = write_campaign(&folder, &SPRINGS.replace("\"sobol\"", "\"latin-hypercube\""));
    sweep(&file, "hypercube", &["--points", "4"]);
    let parts = [
        "4 points of a Latin hypercube",
        "cannot become one of 16",
        "random or sobol",
    ];
    assert_refused(&file, "hypercube", &[], &parts);
    let grid = "scenario = \"../springs.toml\"\nseeds = \"same\"\n\n[vary.late]\nkey = \"connections.to-right.delay\"\n\
                distribution = \"discrete\"\nvalues = [\"0 ms\", \"10 ms\"]\ndesign = \"grid\"\n";
    let file = write_campaign(&folder, grid);
    assert_refused(
        &file,
        "grid",
        &["--points", "4"],
        &["points", "all dispersions are on the grid"],
    );
    assert!(!out("grid").exists(), "nothing is written");
    let scenario = out("springs.toml");
    assert_refused(
        &scenario,
        "none",
        &["--points", "4"],
        &["--points", "is not a campaign file", "--seeds"],
    );
}

#[test]
fn drawn_point_is_rerun_kept_and_counted_by_the_stopping_rule() {
    let folder = Folder::new("drawn-point-again");
    let out = |name: &str| folder.path().join(name);
    let file = write_campaign(&folder, SPRINGS);
    let sweep = |name: &str, more: &[&str]| {
        let place = out(name);
        run_orchestrator(&[&["sweep", text(&file), "--out", text(&place)], more].concat())
    };
    let output = sweep("swept", &["--json", "--digest", "--keep", "worst:2"]);
    let rows = output.json()["rows"].as_array().unwrap().clone();
    assert_eq!(std::fs::read_dir(out("swept/runs")).unwrap().count(), 2);
    let there = |refused: bool| {
        rows.iter()
            .find(|row| (row["outcome"] == "refused") == refused)
            .unwrap()
    };
    let point = |row: &serde_json::Value| format!("{}:{}", out("swept").display(), row["point"]);
    let run = out("run");
    let output = run_orchestrator(&[
        "run",
        "--point",
        &point(there(false)),
        "--in-process",
        "--json",
        "--out",
        text(&run),
    ]);
    assert_eq!(output.json()["tape_digest"], there(false)["tape_digest"], "{output:?}");
    // A sample that cannot be drawn is not run, and in particular not replaced by the nominal scenario.
    let output = run_orchestrator(&["run", "--point", &point(there(true)), "--out", text(&out("no"))]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("cannot be run") && output.err.contains("vary.ratio"),
        "{output:?}"
    );
    let until = ["--until", "met within 25 %", "--quiet", "--digest", "--workers"];
    sweep("until-1", &[&until[..], &["1"]].concat());
    sweep("until-3", &[&until[..], &["3"]].concat());
    let table = |name: &str| std::fs::read_to_string(out(name).join("table.csv")).unwrap();
    assert_eq!(table("until-1"), table("until-3"));
    let count = table("until-1").lines().count();
    assert!(count > 2 && count < 17, "{count}");
    assert!(table("swept").starts_with(&table("until-1")), "the first points of all");
}
