//! Damaged and incomplete campaign folders: damaged points are rejected, and missing ones are reported.

use std::path::{Path, PathBuf};

use escapement_tests::fixture::write_springs;
use escapement_tests::program::{Folder, ProgramOutput, run_orchestrator, text};

const CAMPAIGN: &str = r#"scenario = "springs.toml"
points = 6

[vary.mass]
key = "participants.right.parameters.mass"
distribution = "uniform"
from = "1 kg"
to = "2 kg"
"#;

/// Writes the campaign with its scenario; returns the campaign file.
fn write_campaign(folder: &Folder) -> PathBuf {
    write_springs(folder);
    folder.write("campaign.toml", CAMPAIGN)
}

fn sweep(file: &Path, out: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["sweep", text(file), "--quiet", "--out", text(out)], more].concat())
}

/// Checks that `output` is one error with all of `parts`.
fn assert_refused(output: &ProgramOutput, parts: &[&str]) {
    assert_eq!(output.code, Some(2), "{output:?}");
    assert_eq!(output.err.matches("error:").count(), 1, "{output:?}");
    for part in parts {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
}

/// Replaces the file `name` in `folder` by the result of `change` on its lines.
fn edit_lines(folder: &Path, name: &str, change: impl FnOnce(&mut Vec<String>)) {
    let path = folder.join(name);
    let mut lines: Vec<String> = std::fs::read_to_string(&path)
        .unwrap()
        .lines()
        .map(str::to_owned)
        .collect();
    change(&mut lines);
    std::fs::write(path, lines.join("\n") + "\n").unwrap();
}

#[test]
fn damaged_points_are_refused_and_rewritten() {
    let folder = Folder::new("damaged-points");
    let out = |name: &str| folder.path().join(name);
    let file = write_campaign(&folder);
    let whole = out("whole");
    assert_eq!(sweep(&file, &whole, &[]).code, Some(0));
    let points = std::fs::read_to_string(whole.join("points.jsonl")).unwrap();
    let table = std::fs::read_to_string(whole.join("table.csv")).unwrap();
    let other = |line: &str| line.replace("mass=1.", "mass=9.");
    type Damage<'a> = (&'a dyn Fn(&mut Vec<String>), &'a [&'a str]);
    let damages: [Damage<'_>; 5] = [
        (&|lines| drop(lines.remove(2)), &["the row of point 3 is missing: "]),
        (
            &|lines| lines.truncate(2),
            &["the row of point 3 is missing, and those of 3 others"],
        ),
        (&|lines| lines[1].truncate(20), &["line 2 is no row of a point"]),
        (
            &|lines| lines[4] = lines[4].replace("\"texts\":[", "\"texts\":[\"x\","),
            &["line 5 has other columns"],
        ),
        (
            &|lines| lines.iter_mut().for_each(|line| *line = other(line)),
            &["not those that the campaign was started with", "digest"],
        ),
    ];
    for (damage, parts) in damages {
        edit_lines(&whole, "points.jsonl", damage);
        let again = run_orchestrator(&["sweep", "run", text(&whole)]);
        assert_refused(
            &again,
            &[
                &["points.jsonl", "give the command that started the campaign again"],
                parts,
            ]
            .concat(),
        );
        let point = format!("{}:1", whole.display());
        assert_refused(&run_orchestrator(&["run", "--point", &point]), parts);
        // The remedy in the message.
        assert_eq!(sweep(&file, &whole, &[]).code, Some(0));
        assert_eq!(std::fs::read_to_string(whole.join("points.jsonl")).unwrap(), points);
        assert_eq!(std::fs::read_to_string(whole.join("table.csv")).unwrap(), table);
    }
    // A shard cannot know the digest of all points; merging compares it.
    let shards = [out("one"), out("two")];
    for (shard, number) in shards.iter().zip(["1/2", "2/2"]) {
        assert_eq!(sweep(&file, shard, &["--shard", number]).code, Some(0));
    }
    edit_lines(&shards[1], "points.jsonl", |lines| drop(lines.remove(0)));
    let merge = || {
        run_orchestrator(&[
            "sweep",
            "merge",
            text(&out("merged")),
            text(&shards[0]),
            text(&shards[1]),
        ])
    };
    assert_refused(&merge(), &["two/points.jsonl", "the row of point 2 is missing"]);
    assert_eq!(sweep(&file, &shards[1], &["--shard", "2/2"]).code, Some(0));
    edit_lines(&shards[0], "points.jsonl", |lines| {
        lines.iter_mut().for_each(|line| *line = other(line))
    });
    assert_refused(&merge(), &["points.jsonl of the shards", "digest"]);
    assert!(!out("merged").exists(), "nothing is written");
}

fn status(folder: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["sweep", "status", text(folder)], more].concat())
}

#[test]
fn status_counts_points_unknown_to_a_shard() {
    let folder = Folder::new("left-behind");
    let out = |name: &str| folder.path().join(name);
    let file = write_campaign(&folder);
    let both = out("both");
    let shard = |number: &str, points: &str| {
        let place = both.join(number.replace('/', "-of-"));
        let output = sweep(&file, &place, &["--shard", number, "--points", points]);
        assert_eq!(output.code, Some(0), "{output:?}");
    };
    let assert_status = |code: i32, parts: &[&str]| {
        let output = status(&both, &[]);
        assert_eq!(output.code, Some(code), "{output:?}");
        for part in parts {
            assert!(output.out.contains(part), "`{part}` is not in: {}", output.out);
        }
    };
    std::fs::create_dir(&both).unwrap();
    shard("1/2", "4");
    assert_status(
        1,
        &["shard 1/2  2 of 2 points", "2 points are in none of these folders"],
    );
    assert_eq!(
        status(&both.join("1-of-2"), &[]).code,
        Some(0),
        "asked about the shard alone"
    );
    shard("2/2", "6");
    assert_status(
        1,
        &[
            "springs: 6 points",
            "shard 1/2  2 of 3 points",
            "stopped",
            "was started for 4 points, and the campaign has 6",
            "shard 2/2  3 of 3 points",
        ],
    );
    shard("1/2", "6");
    assert_status(0, &["shard 1/2  3 of 3 points"]);
}

#[test]
fn status_counts_no_point_that_runs_again() {
    let folder = Folder::new("crashed-points");
    let out = folder.path().join("out");
    let file = write_campaign(&folder);
    assert_eq!(sweep(&file, &out, &[]).code, Some(0));
    edit_lines(&out, "results.jsonl", |lines| {
        let mut entry: serde_json::Value = serde_json::from_str(&lines[2]).unwrap();
        entry["outcome"] = "crashed".into();
        lines[2] = entry.to_string();
    });
    let output = status(&out, &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.out.contains("5 of 6 points, 1 crashed"), "{output:?}");
    assert!(output.out.contains("continue with: sweep run"), "{output:?}");
    let part = status(&out, &["--json"]).json()["parts"][0].clone();
    assert_eq!(
        (&part["done"], &part["failed"], &part["crashed"]),
        (&5.into(), &0.into(), &1.into()),
        "{part}"
    );
    assert_eq!(run_orchestrator(&["sweep", "run", text(&out), "--quiet"]).code, Some(0));
    assert!(status(&out, &[]).out.contains("6 of 6 points"));
}

#[test]
fn folder_stores_its_stopping_rule() {
    let folder = Folder::new("stored-rule");
    let out = folder.path().join("out");
    let file = write_campaign(&folder);
    let points = || std::fs::read_to_string(out.join("table.csv")).unwrap().lines().count() - 1;
    let rule = ["--points", "40", "--workers", "1", "--until", "met within 12 %"];
    assert_eq!(sweep(&file, &out, &rule).code, Some(0));
    // None of n is met: the interval's half width is z² / 2 (n + z²), which is 12 % from n = 13 on.
    assert_eq!(points(), 13);
    let output = status(&out, &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.out.contains("the first 13 are enough for `met within 12 %`"),
        "{output:?}"
    );
    edit_lines(&out, "results.jsonl", |lines| lines.truncate(5));
    let output = status(&out, &[]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(
        output.out.contains("5 of 40 points, until `met within 12 %`"),
        "{output:?}"
    );
    // The folder alone says where the campaign ends.
    let output = run_orchestrator(&["sweep", "run", text(&out), "--workers", "1", "--quiet"]);
    assert_eq!((output.code, points()), (Some(0), 13), "{output:?}");
    // Without the rule it goes on to its last point.
    assert_eq!(sweep(&file, &out, &rule[..4]).code, Some(0));
    assert_eq!(points(), 40);
    assert!(
        status(&out, &[]).out.contains("40 of 40 points (on "),
        "the rule is gone"
    );
}

#[test]
fn incomplete_run_folders_of_a_killed_campaign_are_removed() {
    let folder = Folder::new("half-kept");
    let out = folder.path().join("out");
    let file = write_campaign(&folder);
    assert_eq!(sweep(&file, &out, &["--keep"]).code, Some(0));
    let table = std::fs::read_to_string(out.join("table.csv")).unwrap();
    let run = |number: usize| out.join(format!("runs/{number:05}"));
    let whole = |number: usize| run(number).join("summary.json").is_file();
    assert!((1..=6).all(whole));
    // As after a kill: one point has no result yet, the folder of another was being made again, and a worker had begun a third.
    let kill = || {
        edit_lines(&out, "results.jsonl", |lines| {
            lines.retain(|line| !line.contains("\"point\":2,"))
        });
        for number in [2, 4] {
            std::fs::create_dir_all(run(number).join("tape")).unwrap();
            let _ = std::fs::remove_file(run(number).join("summary.json"));
        }
        std::fs::create_dir_all(out.join(".worker-7/tape")).unwrap();
    };
    let journal = || {
        let text = std::fs::read_to_string(out.join("results.jsonl")).unwrap();
        assert_eq!(text.lines().count(), 6, "nothing is counted twice: {text}");
    };
    kill();
    assert_eq!(sweep(&file, &out, &[]).code, Some(0));
    let there: Vec<usize> = (1..=6).filter(|number| run(*number).exists()).collect();
    assert_eq!(there, [1, 3, 5, 6], "without --keep none is made again");
    assert!(there.into_iter().all(whole) && !out.join(".worker-7").exists());
    journal();
    kill();
    assert_eq!(sweep(&file, &out, &["--keep"]).code, Some(0));
    assert!((1..=6).all(whole) && !out.join(".worker-7").exists());
    journal();
    assert_eq!(std::fs::read_to_string(out.join("table.csv")).unwrap(), table);
}
