//! Shards of a campaign: together they yield the result of one machine, whatever happens to them.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use escapement_tests::program::{
    Folder, built, orchestrator, root, run_orchestrator, run_program, start_program, text, wait_for_output,
};
use testing::random::SplitMix;

const CLOSE: [&str; 7] = [
    "sweep",
    "scenarios/close.toml",
    "--duration",
    "500 ms",
    "--vary",
    "connections.measured.delay=0ms..30ms:10ms",
    "--vary",
];
const PERIODS: &str = "participants.controller.period=10ms,20ms";

/// The capture over delays and periods.
fn close_arguments(more: &[&str]) -> Vec<String> {
    strings(&[&CLOSE[..], &[PERIODS, "--quiet"], more].concat())
}

/// The lander, a separate program, over delays.
fn lander_arguments(more: &[&str]) -> Vec<String> {
    let own = [
        "sweep",
        "examples/lander/lander.toml",
        "--vary",
        "connections.motion.delay=0ms..400ms:40ms",
        "--quiet",
    ];
    strings(&[&own[..], more].concat())
}

fn strings(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// The arguments of a campaign of a system.
type Sweep = fn(&[&str]) -> Vec<String>;

/// Two systems that share nothing, with their programs.
fn systems() -> [(PathBuf, Sweep); 2] {
    [
        (orchestrator().to_owned(), close_arguments),
        (built().join("lander"), lander_arguments),
    ]
}

/// Table and pictures.
fn files(folder: &Path) -> Vec<Vec<u8>> {
    ["table.csv", "table.parquet", "figure.svg", "figure.png"]
        .iter()
        .map(|name| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}")))
        .collect()
}

/// The points in a folder's journal, in their order.
fn journal(folder: &Path) -> Vec<u64> {
    let text = std::fs::read_to_string(folder.join("results.jsonl")).unwrap_or_default();
    let lines = text
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    let mut points: Vec<u64> = lines
        .filter(|line| line.get("audit").is_none())
        .filter_map(|line| line["point"].as_u64())
        .collect();
    points.sort_unstable();
    points
}

#[test]
fn merged_shards_give_the_table_of_one_machine() {
    for (number, (program, sweep)) in systems().iter().enumerate() {
        let folder = Folder::new("shards");
        let out = |name: &str| folder.path().join(name);
        let output = run_program(program, &sweep(&["--out", text(&out("one"))]));
        assert_eq!(output.code, Some(0), "{output:?}");
        // Shards of different sizes form a whole too.
        let shards = ["1/2", "2/4", "4/4"];
        let mut merge = strings(&["sweep", "merge", text(&out("whole")), "--quiet"]);
        for (at, shard) in shards.iter().enumerate() {
            let place = out(&format!("shard-{at}"));
            let output = run_program(program, &sweep(&["--out", text(&place), "--shard", shard]));
            assert_eq!(output.code, Some(0), "{output:?}");
            merge.push(text(&place).to_owned());
        }
        let output = run_program(program, &merge);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(files(&out("whole")), files(&out("one")), "system {number}");
        // A merged campaign is an ordinary campaign: none of it is run again.
        let output = run_program(program, &sweep(&["--out", text(&out("whole"))]));
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(journal(&out("whole")), journal(&out("one")));
    }
}

#[test]
fn merge_refuses_an_incomplete_set_of_shards() {
    let folder = Folder::new("no-whole");
    let out = |name: &str| folder.path().join(name);
    let shard = |name: &str, shard: &str, more: &[&str]| {
        let output = run_program(
            &built().join("lander"),
            &lander_arguments(&[&["--out", text(&out(name)), "--shard", shard], more].concat()),
        );
        assert_eq!(output.code, Some(0), "{output:?}");
    };
    shard("a", "1/3", &[]);
    shard("b", "2/3", &[]);
    shard("half", "1/2", &[]);
    shard("other", "2/3", &["--duration", "30 s"]);
    shard("more", "2/3", &["--vary", "seed=1,2"]);
    let close = run_orchestrator(&[
        "sweep",
        "scenarios/close.toml",
        "--duration",
        "100 ms",
        "--vary",
        "seed=1..11",
        "--shard",
        "3/3",
        "--quiet",
        "--out",
        text(&out("close")),
    ]);
    assert!(close.code == Some(0), "{close:?}");
    let assert_refused = |shards: &[&str], parts: &[&str]| {
        let places: Vec<PathBuf> = shards.iter().map(|name| out(name)).collect();
        let mut arguments = strings(&["sweep", "merge", text(&out("whole"))]);
        arguments.extend(places.iter().map(|place| text(place).to_owned()));
        let output = run_program(&built().join("lander"), &arguments);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert_eq!(output.err.matches("error:").count(), 1, "{}", output.err);
        for part in parts {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
        assert!(!out("whole").exists(), "nothing is written");
    };
    assert_refused(
        &["a", "b"],
        &["3 of 11 points are missing", "such as point 3, 6, 9", "all shards"],
    );
    assert_refused(
        &["a", "half"],
        &["point 1 is in", "a and in", "half", "each shard once"],
    );
    assert_refused(&["a", "b", "a"], &["point 1 is in"]);
    assert_refused(
        &["a", "other"],
        &["not of one campaign", "the scenario or a file of it is not the same"],
    );
    assert_refused(
        &["a", "more"],
        &["not of one campaign", "the points are not the same (11 and 22)"],
    );
    assert_refused(&["a", "close"], &["not of one campaign", "another build"]);
    assert_refused(&["a", "nowhere"], &["nowhere", "no campaign.json"]);
    // A shard that was stopped on the way.
    let text_of = std::fs::read_to_string(out("b").join("results.jsonl")).unwrap();
    let first: String = text_of.split_inclusive('\n').take(1).collect();
    std::fs::write(out("b").join("results.jsonl"), first + "{\"point\": 5, \"outc").unwrap();
    shard("c", "3/3", &[]);
    assert_refused(
        &["a", "b", "c"],
        &["3 of 11 points are missing", "3 of", "start it again"],
    );
}

/// Starts a shard repeatedly, and kills it at random instants within the duration of the whole campaign, until it is complete.
fn run_killed(program: &Path, arguments: &[String], alone: Duration, random: &mut SplitMix) -> usize {
    let mut kills = 0;
    loop {
        let mut child = start_program(program, arguments);
        std::thread::sleep(alone.mul_f64((random.bits() % 1000) as f64 / 1000.0));
        if kills < 60 && child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            kills += 1;
        }
        let output = wait_for_output(child);
        match output.code {
            None => {}
            Some(0) => return kills,
            code => panic!("{code:?}: {output:?}"),
        }
    }
}

/// Every shard is killed at random instants until it is complete.
#[test]
fn killed_shards_lose_or_repeat_no_point() {
    let mut random = SplitMix(19);
    for (program, sweep) in &systems() {
        let folder = Folder::new("killed-shards");
        let out = |name: &str| folder.path().join(name);
        let begun = Instant::now();
        let output = run_program(program, &sweep(&["--out", text(&out("one"))]));
        let alone = begun.elapsed();
        assert_eq!(output.code, Some(0), "{output:?}");
        let mut merge = strings(&["sweep", "merge", text(&out("whole")), "--quiet"]);
        for number in 1..=2 {
            let place = out(&format!("shard-{number}"));
            let shard = format!("{number}/2");
            let arguments = sweep(&["--out", text(&place), "--shard", &shard, "--workers", "2"]);
            // A shard that was complete before it was killed often prints little, and is started from the beginning.
            let mut kills = run_killed(program, &arguments, alone, &mut random);
            while kills < 12 {
                std::fs::remove_dir_all(&place).unwrap();
                kills += run_killed(program, &arguments, alone, &mut random);
            }
            merge.push(text(&place).to_owned());
        }
        let output = run_program(program, &merge);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(files(&out("whole")), files(&out("one")));
        let mut both = [journal(&out("shard-1")), journal(&out("shard-2"))].concat();
        both.sort_unstable();
        assert_eq!(both, journal(&out("one")), "each point once");
    }
}

#[test]
fn status_reports_the_progress_of_each_shard() {
    let folder = Folder::new("status");
    let out = |name: &str| folder.path().join(name);
    let output = run_program(
        &built().join("lander"),
        &lander_arguments(&["--out", text(&out("1-of-2")), "--shard", "1/2"]),
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = run_program(
        &built().join("lander"),
        &lander_arguments(&["--out", text(&out("2-of-2")), "--shard", "2/2"]),
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    let journal = out("2-of-2/results.jsonl");
    let lines = std::fs::read_to_string(&journal).unwrap();
    let some: String = lines.split_inclusive('\n').take(2).collect();
    std::fs::write(&journal, some).unwrap();
    let status = |more: &[&str]| run_orchestrator(&[&["sweep", "status", text(folder.path())], more].concat());
    let output = status(&[]);
    assert_eq!(output.code, Some(1), "points are missing: {output:?}");
    for part in [
        "shard 1/2  6 of 6 points",
        "complete",
        "shard 2/2  2 of 5 points",
        "stopped",
        "sweep run",
    ] {
        assert!(output.out.contains(part), "`{part}` is not in: {}", output.out);
    }
    // The printed command completes the shard.
    let output = run_program(
        &built().join("lander"),
        &strings(&["sweep", "run", text(&out("2-of-2")), "--quiet"]),
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    let json = status(&["--json"]);
    assert_eq!((json.code, json.json()["complete"].as_bool()), (Some(0), Some(true)));
    let parts = json.json()["parts"].as_array().unwrap().clone();
    assert_eq!(parts.len(), 2);
    assert_eq!(
        (parts[1]["done"].as_u64(), parts[1]["points"].as_u64()),
        (Some(5), Some(5))
    );
    assert_ne!(parts[1]["nodes"][0].as_str().unwrap_or_default(), "");
    // A campaign of one machine, and one that is in progress.
    let one = out("one");
    let arguments = [
        "sweep",
        "scenarios/close.toml",
        "--vary",
        "seed=1..1000",
        "--workers",
        "1",
        "--quiet",
        "--out",
        text(&one),
    ];
    let mut child = escapement_tests::program::start_orchestrator(&arguments);
    let running = || run_orchestrator(&["sweep", "status", text(&one), "--json"]);
    let part = loop {
        let output = running();
        if output.code == Some(1) && output.json()["parts"][0]["done"].as_u64() > Some(0) {
            break output.json()["parts"][0].clone();
        }
    };
    assert_eq!(
        (part["state"].as_str(), part["running"].as_u64()),
        (Some("running"), Some(1)),
        "{part}"
    );
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(running().json()["parts"][0]["state"], "stopped");
    let output = run_orchestrator(&["sweep", "status", text(&root().join("docs"))]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("no campaign.json"), "{output:?}");
}

/// The folder has three shards, each with second runs of points of the one before.
fn assert_merge_reports_what_was_compared(folder: &Folder) {
    let out = |name: &str| folder.path().join(name);
    let program = built().join("lander");
    let merge = |whole: &str, first: &str, more: &[&str]| {
        let mut arguments = strings(&["sweep", "merge", text(&out(whole))]);
        arguments.extend([first, "2-of-3", "3-of-3"].map(|name| text(&out(name)).to_owned()));
        arguments.extend(strings(more));
        run_program(&program, &arguments)
    };
    let output = merge("reported", "1-of-3", &[]);
    assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
    assert!(
        output.out.contains("points were run twice, with the same bits"),
        "{output:?}"
    );
    let plain = out("plain");
    let output = run_program(
        &program,
        &lander_arguments(&["--out", text(&plain), "--shard", "1/3", "--digest"]),
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = merge("partly", "plain", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("plain: run without --audit") && !output.err.contains("2-of-3"),
        "{output:?}"
    );
    // A figure that the points do not have is refused before anything is written.
    let output = merge("unwritten", "1-of-3", &["--figure", "nope"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("`nope`"), "{output:?}");
    assert!(!out("unwritten").exists());
}

#[test]
fn audit_names_the_node_whose_bits_differ() {
    let folder = Folder::new("audit");
    let out = |name: &str| folder.path().join(name);
    let program = built().join("lander");
    for shard in ["1/3", "2/3", "3/3"] {
        let place = out(&shard.replace('/', "-of-"));
        let output = run_program(
            &program,
            &lander_arguments(&["--out", text(&place), "--shard", shard, "--audit", "50%"]),
        );
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    let merge = || {
        let mut arguments = strings(&["sweep", "merge", text(&out("whole")), "--quiet"]);
        arguments.extend(["1-of-3", "2-of-3", "3-of-3"].map(|name| text(&out(name)).to_owned()));
        run_program(&program, &arguments)
    };
    assert_eq!(merge().code, Some(0));
    assert_merge_reports_what_was_compared(&folder);
    // The second shard ran on a machine that computes different results.
    let journal = out("2-of-3/results.jsonl");
    let honest = std::fs::read_to_string(&journal).unwrap();
    assert!(honest.matches("\"audit\":true").count() > 0, "{honest}");
    let broken: Vec<String> = honest
        .lines()
        .map(|line| {
            let mut entry: serde_json::Value = serde_json::from_str(line).unwrap();
            entry["node"] = "broken".into();
            entry["tape"] = "0000".into();
            entry.to_string() + "\n"
        })
        .collect();
    std::fs::write(&journal, broken.concat()).unwrap();
    std::fs::remove_dir_all(out("whole")).unwrap();
    let output = merge();
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("most often on node `broken`"), "{output:?}");
    assert!(
        output.err.contains("2-of-3 on node `broken`") && output.err.contains("run --point"),
        "{output:?}"
    );
    // A missing second run is a gap.
    let first: String = honest
        .split_inclusive('\n')
        .filter(|line| !line.contains("\"audit\":true"))
        .collect();
    std::fs::write(&journal, first).unwrap();
    let output = merge();
    assert!(
        output.err.contains("has not yet run point 1 a second time"),
        "{output:?}"
    );
    let output = run_program(&program, &lander_arguments(&["--audit", "1%"]));
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("--shard"), "{output:?}");
}
