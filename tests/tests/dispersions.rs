//! Campaign files from the user's point of view: one table despite interruptions, rejected distributions, and the page.

use std::process::Command;

use escapement_tests::fixture::{write_oscillator, write_springs};
use escapement_tests::program::{Folder, root, run_orchestrator, start_orchestrator, text, wait_for_output};

const CAMPAIGN: &str = r#"
title = "Two masses that nobody has weighed"
scenario = "springs.toml"
points = 30
design = "latin-hypercube"

[vary.mass]
key = "participants.right.parameters.mass"
distribution = "normal"
mean = "1 kg"
deviation = "0.6 kg"

[vary.late]
key = "connections.to-right.delay"
distribution = "uniform"
from = "0 ms"
to = "40 ms"
round = "0.1 ms"

[vary.push_at]
key = "faults.push.at"
distribution = "uniform"
from = "0 ms"
to = "150 ms"
round = "1 ms"

[vary.push_what]
key = "faults.push.kind"
distribution = "discrete"
values = ["bias", "noise"]
"#;

fn result_files(folder: &Folder, out: &str) -> Vec<Vec<u8>> {
    ["table.csv", "table.parquet", "figure.svg", "report.html"]
        .iter()
        .map(|name| std::fs::read(folder.path().join(out).join(name)).unwrap_or_else(|error| panic!("{name}: {error}")))
        .collect()
}

#[test]
fn table_depends_on_the_campaign_file_alone() {
    let folder = Folder::new("dispersions");
    write_springs(&folder);
    let file = folder.write("campaign.toml", CAMPAIGN);
    let out = |name: &str| folder.path().join(name);
    let run = |name: &str, more: &[&str]| {
        run_orchestrator(&[&["sweep", text(&file), "--out", text(&out(name))], more].concat())
    };
    let output = run("one", &["--workers", "1", "--json"]);
    assert_eq!(output.code, Some(1), "a negative mass is a refused point: {output:?}");
    let json = output.json();
    let refused = json["refused"].as_u64().unwrap();
    assert!(
        refused > 0 && refused < 5,
        "a twentieth of the draws is below zero: {refused}"
    );
    let rows = json["rows"].as_array().unwrap();
    for row in rows {
        let mass = row["values"]["mass"].as_f64().unwrap();
        assert_eq!(row["outcome"] == "refused", mass <= 0.0, "{row}");
        assert!(
            row["outcome"] != "refused" || row["reason"].as_str().unwrap().contains("mass"),
            "{row}"
        );
        assert!(["bias", "noise"].contains(&row["values"]["push_what"].as_str().unwrap()));
    }
    run("three", &["--workers", "3", "--quiet"]);
    assert_eq!(result_files(&folder, "one"), result_files(&folder, "three"));

    // killed during the campaign, and continued
    let stopped = out("stopped");
    let child = start_orchestrator(&[
        "sweep",
        text(&file),
        "--out",
        text(&stopped),
        "--workers",
        "1",
        "--quiet",
    ]);
    let begun = std::time::Instant::now();
    while std::fs::metadata(stopped.join("results.jsonl")).map_or(0, |about| about.len()) == 0 {
        assert!(begun.elapsed().as_secs() < 120, "it never begins");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(
        Command::new("kill")
            .args(["-KILL", &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
    wait_for_output(child);
    let again = run("stopped", &["--quiet"]);
    assert_eq!(again.code, Some(1), "{again:?}");
    assert_eq!(result_files(&folder, "one"), result_files(&folder, "stopped"));
}

#[test]
fn drawn_point_is_the_run_with_its_values() {
    let folder = Folder::new("drawn-point");
    write_springs(&folder);
    let file = folder.write(
        "campaign.toml",
        &CAMPAIGN
            .replace("points = 30", "points = 3")
            .replace("0.6 kg", "0.1 kg"),
    );
    let out = |name: &str| folder.path().join(name);
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out("swept")), "--json", "--digest"]);
    let json = output.json();
    let csv = std::fs::read_to_string(out("swept").join("table.csv")).unwrap();
    assert!(
        csv.starts_with("point,mass [kg],late [ms],push_at [ms],push_what,seed,outcome,reason,swing [m],"),
        "{csv}"
    );
    let row = &json["rows"][2];
    let value = |name: &str, unit: &str| format!("{}{unit}", row["values"][name]);
    let single = run_orchestrator(&[
        "run",
        text(&folder.path().join("springs.toml")),
        "--in-process",
        "--json",
        "--out",
        text(&out("single")),
        "--seed",
        &value("seed", ""),
        "--set",
        &format!("participants.right.parameters.mass={}", value("mass", " kg")),
        "--set",
        &format!("connections.to-right.delay={}", value("late", " ms")),
        "--set",
        &format!("faults.push.at={}", value("push_at", " ms")),
        "--set",
        &format!("faults.push.kind={}", row["values"]["push_what"].as_str().unwrap()),
    ]);
    assert_eq!(single.json()["tape_digest"], row["tape_digest"]);
    let journal = std::fs::read_to_string(out("swept").join("results.jsonl")).unwrap();
    let mut entries = journal
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let third = entries.rfind(|entry| entry["point"] == 3).unwrap();
    assert_eq!(third["values"], row["values"]);
}

#[test]
fn page_has_statistics_of_every_figure() {
    let folder = Folder::new("campaign-page");
    write_springs(&folder);
    let file = folder.write(
        "campaign.toml",
        &CAMPAIGN
            .replace("latin-hypercube", "saltelli")
            .replace("points = 30", "points = 8")
            .replace("0.6 kg", "0.1 kg"),
    );
    let out = folder.path().join("out");
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out), "--quiet"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    let data = page
        .split_once("id=\"data\">")
        .unwrap()
        .1
        .split_once("</script>")
        .unwrap()
        .0;
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(
        (data["points"].as_u64(), &data["title"]),
        (Some(48), &"Two masses that nobody has weighed".into())
    );
    assert_eq!(
        data["factors"],
        serde_json::json!(["mass", "late", "push_at", "push_what"])
    );
    let swing = data["measures"]
        .as_array()
        .unwrap()
        .iter()
        .find(|one| one["name"] == "swing")
        .unwrap();
    assert_eq!(swing["count"], 48);
    assert_eq!(swing["indices"]["rows"], 8);
    assert_eq!(swing["indices"]["of"].as_array().unwrap().len(), 4);
    assert_eq!(swing["correlations"].as_array().unwrap().len(), 4);
    assert!(
        (swing["limits"][0].as_f64().unwrap() - 0.0009).abs() < 1e-12,
        "{}",
        swing["limits"]
    );
    assert!(
        !page.contains("src=") && !page.contains("href=\"http"),
        "the page needs nothing from elsewhere"
    );
}

#[test]
fn key_invalid_at_every_point_is_refused_as_the_dispersion() {
    let folder = Folder::new("campaign-refused");
    write_springs(&folder);
    let out = folder.path().join("out");
    for (before, after, parts) in [
        (
            "parameters.mass",
            "parameters.mas",
            ["campaign.toml:7: vary.mass", "unknown field `mas`"],
        ),
        (
            "mean = \"1 kg\"",
            "mean = \"-9 kg\"",
            ["campaign.toml:7: vary.mass", "all of the first 20 points are refused"],
        ),
        (
            "participants.right.parameters.mass",
            "participants.rihgt.parameters.mass",
            ["vary.mass", "there is no `rihgt`"],
        ),
        ("faults.push.at", "faults.pull.at", ["vary.push_at", "no entry `pull`"]),
        (
            "scenario = \"springs.toml\"",
            "scenario = \"sprigns.toml\"",
            ["sprigns.toml", "cannot be read"],
        ),
    ] {
        let file = folder.write("campaign.toml", &CAMPAIGN.replace(before, after));
        let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in parts {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
        assert!(!out.exists(), "nothing is written");
    }
    let file = folder.write("campaign.toml", CAMPAIGN);
    let output = run_orchestrator(&["sweep", text(&file), "--vary", "seed=1,2", "--out", text(&out)]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("says what varies"), "{output:?}");
}

#[test]
fn scenario_with_own_campaign_runs_alone_and_as_campaign() {
    let folder = Folder::new("campaign-table");
    let own = write_springs(&folder);
    let scenario = std::fs::read_to_string(folder.path().join(own)).unwrap();
    let campaign = "\n[campaign]\npoints = 3\n\n[campaign.vary.mass]\nkey = \"participants.left.parameters.mass\"\n\
                    distribution = \"log-normal\"\nmedian = 1.0\nlog-deviation = \"10 %\"\nas = \"factor\"\n";
    let file = folder.write("both.toml", &(scenario + campaign));
    let run = run_orchestrator(&[
        "run",
        text(&file),
        "--in-process",
        "--quiet",
        "--out",
        text(&folder.path().join("run")),
    ]);
    assert!(run.code == Some(0) || run.code == Some(3), "{run:?}");
    let out = folder.path().join("out");
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out), "--json"]);
    assert_eq!(output.json()["points"], 3, "{output:?}");
    let wrong = folder.write(
        "wrong.toml",
        &std::fs::read_to_string(&file)
            .unwrap()
            .replace("log-normal", "log-norml"),
    );
    let output = run_orchestrator(&["sweep", text(&wrong), "--out", text(&out)]);
    assert!(output.err.contains("campaign.vary.mass.distribution"), "{output:?}");
}

#[test]
fn campaign_file_is_no_scenario() {
    for command in ["check", "run"] {
        let output = run_orchestrator(&[command, text(&root().join("campaigns/dispersed-captures.toml"))]);
        assert_eq!(output.code, Some(2), "{output:?}");
        let expected = "dispersed-captures.toml:5: scenario: this is a campaign file: run it with `sweep`";
        assert!(output.err.contains(expected), "{output:?}");
    }
}

#[test]
fn options_that_a_campaign_file_ignores_are_refused_by_name() {
    let folder = Folder::new("ignored");
    write_springs(&folder);
    let file = folder.write("campaign.toml", CAMPAIGN);
    let assert_refused = |arguments: &[&str], words: &[&str]| {
        let output = run_orchestrator(&[&["sweep"], arguments].concat());
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(words.iter().all(|word| output.err.contains(word)), "{output:?}");
    };
    let set = "participants.right.parameters.mass=\"9 kg\"";
    assert_refused(
        &[text(&file), "--set", set],
        &["participants.right.parameters.mass", "vary.mass"],
    );
    assert_refused(&[text(&file), "--include", "notes.txt"], &["--include", "--bundle"]);
    assert_refused(
        &[text(&file), "--on", "shell", "--engine-args", "--long"],
        &["--engine-args"],
    );
    for name in ["seed", "level", "\"\""] {
        let named = folder.write(
            "named.toml",
            &CAMPAIGN.replace("[vary.mass]", &format!("[vary.{name}]")),
        );
        assert_refused(&[text(&named)], &["named.toml", "choose another"]);
    }
    folder.write("masses.csv", "\u{feff}mass [kg],c\n1,2\nn/a,3\n");
    let column = CAMPAIGN.replace(
        "distribution = \"normal\"\nmean = \"1 kg\"\ndeviation = \"0.6 kg\"",
        "distribution = \"column\"\nfile = \"masses.csv\"\ncolumn = \"mass\"",
    );
    let column = folder.write("column.toml", &column);
    assert_refused(&[text(&column)], &["column.toml", "masses.csv", "`n/a`"]);
}

#[test]
fn campaign_without_a_possible_point_is_refused_before_it_runs() {
    let folder = Folder::new("no-possible-point");
    write_springs(&folder);
    let formula = "scenario = \"springs.toml\"\npoints = 3\n\n[vary.part]\ndistribution = \"discrete\"\nvalues = [0, 0]\n\n\
                   [vary.ratio]\ndistribution = \"formula\"\nformula = \"1 / part\"\n";
    let file = folder.write("campaign.toml", formula);
    let out = folder.path().join("out");
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out)]);
    assert_eq!((output.code, output.out.as_str()), (Some(2), ""), "{output:?}");
    assert_eq!(output.err.lines().count(), 1, "{output:?}");
    for part in [
        "campaign.toml:10: vary.ratio.formula: ",
        "all of the first 3 points are refused",
        "inf is drawn, which is not finite",
        "correct it",
    ] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    assert!(!out.exists(), "nothing is written");
    // One possible point is enough.
    let file = folder.write(
        "campaign.toml",
        &formula
            .replace("[0, 0]", "[0, 1]\nweights = [1, 1]")
            .replace("= 3", "= 20"),
    );
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out)]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.out.contains("refused at 0.0, inf"), "{output:?}");
}

#[test]
fn campaign_of_failed_points_reports_no_share() {
    let folder = Folder::new("no-share");
    let file = write_oscillator(&folder, "panics");
    let out = folder.path().join("out");
    let output = run_orchestrator(&["sweep", text(&file), "--seeds", "2", "--out", text(&out)]);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.out.contains("2 points: 2 failed"), "{output:?}");
    assert!(
        output.out.contains("no point ran to its end, so no share is known"),
        "{output:?}"
    );
    assert!(!output.out.contains("confidence"), "{output:?}");
}
