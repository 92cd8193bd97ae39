//! Campaigns for a rare event: known probabilities, the same result after interruptions, and rejected input.

use std::path::Path;
use std::time::Instant;

use escapement_tests::program::{
    Folder, built, root, run_orchestrator, run_program, start_orchestrator, text, wait_for_output,
};
use testing::random::SplitMix;

const CAMPAIGN: &str = r#"
title = "How often a swing is too wide"
scenario = "springs.toml"
points = 300
seed = 5
design = "subset"

[vary.start]
key = "participants.left.parameters.position"
distribution = "normal"
mean = "0 mm"
deviation = "4 mm"

[vary.other_mass_that_nobody_sees]
distribution = "uniform"
from = 0
to = 1
"#;

const CRITERION: &str =
    "\n[measures.swing]\nof = \"right.motion.position\"\ncompute = \"max-abs\"\nat-most = \"1.2 mm\"\n";

/// The probability of a standard normal number beyond `x` to either side, by Simpson's rule.
fn normal_tail_probability(x: f64) -> f64 {
    let density = |t: f64| (-0.5 * t * t).exp() / std::f64::consts::TAU.sqrt();
    let step = 10.0 / 2000.0;
    let sum: f64 = (0..2000)
        .map(|at| {
            let from = x + f64::from(at) * step;
            (density(from) + 4.0 * density(from + 0.5 * step) + density(from + step)) * step / 6.0
        })
        .sum();
    2.0 * sum
}

/// Two masses; the initial position of the left one is random.
fn springs(folder: &Folder, more: &str) {
    let scenario = std::fs::read_to_string(root().join("orchestrator/src/templates/spring.toml")).unwrap();
    folder.write(
        "springs.toml",
        &(scenario.replace("10 s\"", "200 ms\"") + CRITERION + more),
    );
}

/// Table, journal in the order of its points, page and the estimate of the event.
fn files(folder: &Path) -> Vec<String> {
    let read =
        |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let mut lines: Vec<String> = read("results.jsonl").lines().map(str::to_owned).collect();
    lines.sort();
    let mut files = ["table.csv", "report.html", "rare.json", "points.jsonl"]
        .map(read)
        .to_vec();
    files.push(lines.join("\n"));
    files
}

#[test]
fn probability_equals_the_known_one_despite_interruptions() {
    let folder = Folder::new("rare");
    springs(&folder, "");
    let file = folder.write("rare.toml", CAMPAIGN);
    // The system is linear: the swing for one start determines the swing for all.
    let one = run_orchestrator(&[
        "run",
        text(&folder.path().join("springs.toml")),
        "--in-process",
        "--out",
        text(&folder.path().join("run")),
        "--json",
    ]);
    let one = one.json();
    let swing = one["measures"]["swing"]["value"]
        .as_f64()
        .unwrap_or_else(|| panic!("{one}"));
    let (swing, limit, deviation) = (swing * 1e3 / 100.0, 1.2, 4.0);
    let truth = normal_tail_probability(limit / (swing * deviation));
    assert!((1e-5..1e-3).contains(&truth), "{truth:e} is what is looked for");

    let out = |name: &str| folder.path().join(name);
    let sweep = |name: &str, more: &[&str]| {
        run_orchestrator(&[&["sweep", text(&file), "--out", text(&out(name))], more].concat())
    };
    let output = sweep("one", &["--workers", "1", "--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let known = output.json()["rare"].clone();
    let [low, high] = [0, 1].map(|at| known["interval"][at].as_f64().unwrap());
    assert!(low < truth && truth < high, "{low:e} to {high:e}, not {truth:e}");
    assert!(high / low < 100.0, "{low:e} to {high:e}"); // few misses have independent ancestors
    assert!(known["points"].as_u64().unwrap() < 2000, "{known}");
    let centre = known["centre"].as_array().unwrap();
    assert_eq!(centre[0][0], "start");
    // It may be too wide to either side; samples that are not seen do not matter.
    assert!(centre[1][1].as_f64().unwrap().abs() < 1.0, "{centre:?}");
    let curve = known["exceedance"].as_array().unwrap();
    for point in curve {
        let [value, part] = [0, 1].map(|at| point[at].as_f64().unwrap());
        let truth = normal_tail_probability(value / (swing * deviation));
        assert!(
            truth < 1e-4 || (part / truth).ln().abs() < 0.8,
            "beyond {value}: {part:e}, not {truth:e}"
        );
    }

    let output = sweep("three", &["--workers", "3"]);
    let result = "swing (at most 1.20 mm) is missed with a probability of";
    assert!(output.out.contains(result), "{output:?}");
    assert_eq!(files(&out("one")), files(&out("three")));

    // Killed repeatedly, at any level.
    let mut random = SplitMix(7);
    let begun = Instant::now();
    sweep("measured", &["--quiet"]);
    let alone = begun.elapsed();
    let mut kills = 0;
    loop {
        let mut child = start_orchestrator(&["sweep", text(&file), "--out", text(&out("killed")), "--quiet"]);
        std::thread::sleep(alone.mul_f64((random.bits() % 1000) as f64 / 1000.0));
        if kills < 10 && child.try_wait().unwrap().is_none() {
            child.kill().unwrap();
            kills += 1;
        }
        if wait_for_output(child).code == Some(0) {
            break;
        }
    }
    assert_eq!(files(&out("one")), files(&out("killed")), "after {kills} kills");

    // A point repeated alone, with the same tape.
    let last = format!("{}:{}", text(&out("one")), known["points"]);
    let again = run_orchestrator(&["run", "--point", &last, "--in-process", "--out", text(&out("again"))]);
    assert!(
        matches!(again.code, Some(0 | 3)) && !again.err.contains("another tape"),
        "{again:?}"
    );
}

/// A separate program, a limit from below, two dispersions, other proportions: how often a lander starts too
/// fast.
#[test]
fn lander_that_falls_too_fast_is_found_too() {
    let program = built().join("lander");
    let folder = Folder::new("rare-lander");
    let scenario = std::fs::read_to_string(root().join("examples/lander/lander.toml")).unwrap();
    let speed = "[measures.fall]\nof = \"lander.motion.velocity\"\ncompute = \"at\"\nat = \"5 ms\"\nat-least = \"-40 m/s\"\n\n[measures.touchdown]";
    let scenario = scenario
        .replace("\"60 s\"", "\"50 ms\"")
        .replace("[measures.touchdown]", speed);
    folder.write("lander.toml", &scenario);
    let campaign = "scenario = \"lander.toml\"\npoints = 200\ndesign = \"subset\"\n[subset]\nshare = 0.2\ncriterion = \"CRITERION\"\n\
                    [vary.late]\nkey = \"connections.motion.delay\"\ndistribution = \"triangular\"\nfrom = \"0 ms\"\nmode = \"20 ms\"\n\
                    to = \"300 ms\"\nround = \"1 ms\"\n\
                    [vary.push]\nkey = \"participants.lander.parameters.velocity\"\ndistribution = \"normal\"\nas = \"offset\"\n\
                    deviation = \"3 m/s\"\n";
    let out = folder.path().join("out");
    let sweep = |criterion: &str, more: &[&str]| {
        let file = folder.write("rare.toml", &campaign.replace("CRITERION", criterion));
        run_program(&program, &[&["sweep", text(&file), "--out", text(&out)], more].concat())
    };
    let output = sweep("nothing", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in ["there is no criterion `nothing`: there is `", "`fall`", "`propellant`"] {
        assert!(output.err.contains(part), "{output:?}");
    }
    let output = sweep("fall", &["--json"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let json = output.json();
    let (rows, known) = (json["rows"].as_array().unwrap(), &json["rare"]);
    // The initial speed is 30 m/s, and nothing changes it within 5 ms.
    let truth = normal_tail_probability(10.0 / 3.0) / 2.0;
    let [low, high] = [0, 1].map(|at| known["interval"][at].as_f64().unwrap());
    assert!(
        low < truth && truth < high && high / low < 10.0,
        "{low:e} to {high:e}, not {truth:e}"
    );
    assert_eq!(Some(rows.len() as u64), known["points"].as_u64());
    assert!(
        rows.iter()
            .all(|row| row["values"]["parent"].as_u64() < row["point"].as_u64())
    );
    let centre: Vec<f64> = [0, 1].map(|at| known["centre"][at][1].as_f64().unwrap()).to_vec();
    assert!(centre[0].abs() < 1.0 && (-4.5..-3.3).contains(&centre[1]), "{centre:?}");
}

#[test]
fn invalid_subset_simulation_is_refused() {
    let folder = Folder::new("rare-refused");
    springs(&folder, "");
    let out = folder.path().join("out");
    let assert_refused = |text_of: &str, more: &[&str], parts: &[&str]| {
        let file = folder.write("wrong.toml", text_of);
        let output = run_orchestrator(&[&["sweep", text(&file), "--out", text(&out), "--quiet"], more].concat());
        assert_eq!(output.code, Some(2), "{output:?}");
        for part in parts {
            assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
        }
        assert!(!out.exists(), "nothing is run");
    };
    let with = |from: &str, to: &str| CAMPAIGN.replace(from, to);
    let table = |more: &str| format!("{CAMPAIGN}\n[subset]\n{more}\n");
    assert_refused(
        &with("points = 300", "points = 305"),
        &[],
        &["points", "305 cannot be divided into chains of 10"],
    );
    assert_refused(
        &table("share = 0.3"),
        &[],
        &["subset.share", "0.3 is not one over a whole number"],
    );
    assert_refused(
        &table("levels = 0"),
        &[],
        &["subset.levels", "0 is no whole number from 1 to 100"],
    );
    assert_refused(
        &table("level = 3"),
        &[],
        &["subset.level", "unknown key", "criterion, share, levels"],
    );
    assert_refused(
        &table("criterion = \"speed\""),
        &[],
        &["wrong.toml:20: subset.criterion: ", "no criterion `speed`", "`swing`"],
    );
    assert_refused(
        &with("\"subset\"", "\"random\"").replace("seed = 5", "seed = 5\nsubset = { levels = 3 }"),
        &[],
        &["subset", "write design = \"subset\""],
    );
    assert_refused(
        &with("deviation = \"4 mm\"", "deviation = \"4 mm\"\ndesign = \"sobol\""),
        &[],
        &["vary.start.design", "design subset has one for all dispersions"],
    );
    assert_refused(CAMPAIGN, &["--until", "met within 1 %"], &["--until", "leave it out"]);
    assert_refused(
        CAMPAIGN,
        &["--shard", "1/2"],
        &["--shard", "depend on those before them"],
    );
    assert_refused(CAMPAIGN, &["--on", "shell"], &["--on"]);

    // A folder alone does not determine how such a campaign continues.
    let file = folder.write("rare.toml", CAMPAIGN);
    let made = folder.path().join("made");
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&made), "--quiet", "--points", "100"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let output = run_orchestrator(&["sweep", "run", text(&made), "--quiet"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("sweep ") && output.err.contains("rare.toml --out"),
        "{output:?}"
    );
}

#[test]
fn criterion_without_a_limit_is_refused_for_that_alone() {
    let folder = Folder::new("rare-no-limit");
    springs(
        &folder,
        "\n[measures.e]\nof = \"left.motion.position\"\ncompute = \"rms\"\n",
    );
    let file = folder.write("wrong.toml", &format!("{CAMPAIGN}\n[subset]\ncriterion = \"e\"\n"));
    let out = folder.path().join("out");
    let output = run_orchestrator(&["sweep", text(&file), "--out", text(&out), "--quiet"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in ["wrong.toml:20: subset.criterion: ", "[measures.e] `at-most`", "`swing`"] {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    assert!(!out.exists(), "nothing is run");
}
