//! Measures and criteria of any scenario: verdict, exit code, figures that are the same in every way of running, and measures computed
//! afterwards from tapes.

use std::path::{Path, PathBuf};
use std::process::Command;

use escapement_tests::program::{Folder, ProgramOutput, built, participant, root, run_orchestrator, spring, text};
use serde_json::Value;
use tape::{Reader, Records, Source};

/// Two springs with periods that rarely coincide, and all kinds of measures of them.
fn springs(folder: &Folder) -> PathBuf {
    let scenario = format!(
        r#"title = "Two bobs"
duration = "3 s"

[participants.heavy]
run = {{ exe = "{exe}" }}
period = "3 ms"
parameters = {{ position = 0.1 }}

[participants.light]
run = {{ exe = "{exe}" }}
period = "1/300 s"
offset = "7 ms"
parameters = {{ position = -0.02 }}

[connections.pull]
from = "heavy.motion"
to = "light.neighbour"
delay = "4 ms"

[connections.push]
from = "light.motion"
to = "heavy.neighbour"

[measures.peak]
of = "heavy.motion.position"
compute = "max-abs"
at-most = "10 cm"

[measures.apart]
of = "heavy.motion.position"
minus = "light.motion.position"
compute = "rms"
from = "1 s"
to = "2.5 s"
unit = "mm"

[measures.path]
of = "light.motion.velocity"
compute = "integral-abs"

[measures.swings]
of = "light.motion.position"
compute = "first-crossing"
threshold = "0 m"
within = "[0, 1] s"

[measures.usual]
of = "light.motion.velocity"
minus = "heavy.motion.velocity"
compute = "percentile"
percent = 90

[measures.settled]
of = "heavy.motion.position"
compute = "settling-time"
band = "[-1, 1] mm"
"#,
        exe = spring().display()
    );
    folder.write("bobs.toml", &scenario)
}

/// The results that do not depend on the machine: figures, criteria, verdict and the tape.
fn results_of(summary: &Value) -> [Value; 4] {
    ["measures", "criteria", "verdict", "tape_digest"].map(|key| summary[key].clone())
}

/// Stamps and values of a field of a tape.
fn column(run: &Path, path: &str) -> Vec<(f64, f64)> {
    let tape = Reader::open(run).expect("there is a tape");
    let field = tape.field(path).expect("the field is there");
    let mut records = Records::new(&tape, field.stream);
    let mut column = Vec::new();
    while let Some(record) = records.next().expect("it can be read") {
        column.push((record.stamp_s, field.field.value(record.payload, 0)));
    }
    column
}

fn assert_near(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap_or_else(|| panic!("{value} is no number"));
    assert!((value - expected).abs() <= 1e-12 * expected.abs(), "{value} {expected}");
}

#[test]
fn figures_of_every_way_of_running_equal_those_of_the_tape() {
    let folder = Folder::new("measures");
    let scenario = springs(&folder);
    let out = |name: &str| folder.path().join(name);
    let whole = out("whole");
    let run = run_orchestrator(&["run", text(&scenario), "--json", "--out", text(&whole)]);
    assert_eq!(run.code, Some(0), "{run:?}");
    let summary = run.json();
    assert_eq!(summary["verdict"], "met");
    let vary = [
        "--vary",
        "participants.heavy.parameters.position=0.1,0.2",
        "--json",
        "--digest",
    ];
    let swept = run_orchestrator(&[&["sweep", text(&scenario), "--out", text(&out("sweep"))], &vary[..]].concat());
    assert_eq!(swept.code, Some(0), "{swept:?}");
    let rows = swept.json()["rows"].clone();
    assert_eq!(rows[0]["tape_digest"], summary["tape_digest"]);
    for (name, measure) in summary["measures"].as_object().expect("it has measures") {
        assert_eq!(rows[0]["figures"][name], measure["value"], "{name}");
    }
    assert_eq!(
        (&rows[0]["outcome"], &rows[1]["outcome"]),
        (&Value::from("met"), &Value::from("not-met"))
    );
    assert_eq!(rows[1]["reason"], "peak");
    // the tape, evaluated with the measures of its own scenario and with those of the file
    for more in [&[][..], &["--measures", text(&scenario)]] {
        let asked = run_orchestrator(&[&["measure", text(&whole), "--json"], more].concat());
        assert_eq!(asked.code, Some(0), "{asked:?}");
        assert_eq!(results_of(&asked.json())[..3], results_of(&summary)[..3]);
    }

    // a plain computation over the whole tape
    let figure = |name: &str| summary["measures"][name]["value"].clone();
    let position = column(&whole, "heavy.motion.position");
    let other = column(&whole, "light.motion.position");
    let speed = column(&whole, "light.motion.velocity");
    assert_near(
        &figure("peak"),
        position.iter().map(|(_, x)| x.abs()).fold(0.0, f64::max),
    );
    // Stamps within a nanosecond are one instant: these streams meet every 10 ms.
    let by = |t: f64| {
        other
            .iter()
            .rev()
            .find(|(s, _)| *s <= t + 1e-9)
            .expect("there is one")
            .1
    };
    let window = position.iter().filter(|(t, _)| (1.0..=2.5).contains(t));
    let squares: Vec<f64> = window.map(|(t, x)| (x - by(*t)).powi(2)).collect();
    assert_eq!(squares.len(), 500);
    assert_near(&figure("apart"), 1e3 * (squares.iter().sum::<f64>() / 500.0).sqrt());
    let path: f64 = speed
        .windows(2)
        .map(|two| (two[0].1.abs() + two[1].1.abs()) / 600.0)
        .sum();
    assert_near(&figure("path"), path);
    let crossing = other.iter().find(|(_, x)| *x >= 0.0).expect("it swings").0;
    assert_eq!(figure("swings"), Value::from(crossing));
    assert_eq!(figure("settled"), Value::Null);
    let reason = summary["measures"]["settled"]["reason"].as_str().unwrap_or_default();
    assert!(reason.contains("outside the band"), "{reason}");
}

#[test]
fn one_program_gives_the_same_figures_in_one_loop_and_resumed() {
    let folder = Folder::new("measures-lander");
    let lander = |arguments: &[&str]| {
        let output = Command::new(built().join("lander"))
            .current_dir(root())
            .args(arguments)
            .output();
        let output = output.expect("it can be started");
        let json: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        (output.status.code(), json)
    };
    let out = |name: &str| folder.path().join(name);
    let scenario = "examples/lander/lander.toml";
    let apart = lander(&[
        "run",
        scenario,
        "--json",
        "--checkpoint-at",
        "20s",
        "--out",
        text(&out("apart")),
    ]);
    assert_eq!(apart.0, Some(0), "{:?}", apart.1);
    let one = lander(&["run", scenario, "--json", "--in-process", "--out", text(&out("one"))]);
    assert_eq!(results_of(&one.1), results_of(&apart.1));
    let resumed = lander(&["resume", text(&out("apart")), "--json", "--out", text(&out("resumed"))]);
    assert_eq!(results_of(&resumed.1), results_of(&apart.1));
    let vary = ["--vary", "participants.autopilot.parameters.touchdown=0.5m/s", "--json"];
    let swept = lander(&[&["sweep", scenario, "--out", text(&out("sweep"))], &vary[..]].concat());
    for (name, measure) in one.1["measures"].as_object().expect("it has measures") {
        assert_eq!(swept.1["rows"][0]["figures"][name], measure["value"], "{name}");
    }
}

#[test]
fn missed_criterion_reports_its_margin_and_time() {
    let folder = Folder::new("measures-missed");
    let scenario = springs(&folder);
    let out = folder.path().join("run");
    let run = run_orchestrator(&[
        "run",
        text(&scenario),
        "--set",
        "measures.peak.at-most=40 mm",
        "--set",
        "measures.late={ of = \"light.motion.velocity\", compute = \"final\", from = \"5 s\", at-least = \"0 m/s\" }",
        "--out",
        text(&out),
    ]);
    assert_eq!(run.code, Some(3), "{run:?}");
    for part in [
        "not met: 2 of 3 criteria",
        "FAIL peak                         100 mm (at most 40.0 mm): 60.0 mm too much at t = 0 s",
        "FAIL late                         not measured: there is no sample in the window (at least 0 m/s)",
        "  ok   swings",
    ] {
        assert!(run.out.contains(part), "`{part}` is not in {}", run.out);
    }
    assert!(
        run.err.contains("measures.late.from"),
        "a window behind the end is warned of: {}",
        run.err
    );
    let summary = std::fs::read_to_string(out.join("summary.json")).expect("a run has a summary");
    let summary: Value = serde_json::from_str(&summary).expect("it is JSON");
    assert_eq!(summary["verdict"], "not-met");
    let page = folder.path().join("page.html");
    let report = run_orchestrator(&["report", text(&out), "--out", text(&page)]);
    assert_eq!(report.code, Some(0), "{report:?}");
}

#[test]
fn invalid_measure_is_refused_with_file_line_and_key() {
    let folder = Folder::new("measures-refused");
    let whole = std::fs::read_to_string(springs(&folder)).expect("it was written");
    for (from, to, part) in [
        (
            "\"10 cm\"",
            "\"10 s\"",
            "measures.peak.at-most: `10 s` is not a value in m: it has the dimension s, not m",
        ),
        (
            "of = \"heavy.motion.position\"\ncompute = \"max-abs\"",
            "of = \"heavy.motion.place\"\ncompute = \"max-abs\"",
            "has no field or element `place`",
        ),
        (
            "minus = \"light.motion.position\"",
            "minus = \"light.motion.velocity\"",
            "is in m/s",
        ),
        ("percent = 90", "percent = 900", "between 0 and 100"),
        ("compute = \"rms\"", "compute = \"rss\"", "unknown variant `rss`"),
    ] {
        assert!(whole.contains(from), "{from}");
        let wrong = whole.replacen(from, to, 1);
        let before = &wrong[..wrong.find(to).expect("it is there now")];
        let line = before.matches('\n').count() + 1;
        let scenario = folder.write("wrong.toml", &wrong);
        let output = run_orchestrator(&["run", text(&scenario), "--out", text(&folder.path().join("no"))]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(part), "`{part}` is not in {}", output.err);
        assert!(
            output.err.contains(&format!("wrong.toml:{line}:")),
            "line {line}: {}",
            output.err
        );
        assert!(!folder.path().join("no").exists(), "nothing is left");
    }
}

/// `measure` of the tape in `run`.
fn measure(run: &Path, more: &[&str]) -> ProgramOutput {
    run_orchestrator(&[&["measure", text(run)], more].concat())
}

#[test]
fn measure_command_reads_a_finished_tape() {
    let folder = Folder::new("measures-asked");
    let scenario = springs(&folder);
    let run = folder.path().join("run");
    let output = run_orchestrator(&["run", text(&scenario), "--quiet", "--out", text(&run)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let of = ["--of", "light.motion.velocity", "--compute"];
    let asked = measure(&run, &[&of[..], &["min", "--at-least", "-1 m/s", "--json"]].concat());
    assert_eq!(asked.code, Some(0), "{asked:?}");
    let least = column(&run, "light.motion.velocity")
        .iter()
        .map(|(_, v)| *v)
        .fold(0.0, f64::min);
    assert_eq!(asked.json()["measures"]["min"]["value"], Value::from(least));
    let asked = measure(&run, &[&of[..], &["changes", "--at-most", "3"]].concat());
    assert_eq!(asked.code, Some(3), "{asked:?}");
    assert!(asked.out.contains("too much"), "{asked:?}");
    for (more, part) in [
        (&["max", "--at-most", "3"][..], "--at-most: `3` has no unit"),
        (&["max", "--minus", "light.motion.position"], "--minus: "),
        (&["percentile"], "`percent` is missing"),
        (
            &["max", "--minus", "light.motoin.velocity"],
            "--minus: there is no stream `light.motoin`; there is ",
        ),
        (
            &["max", "--minus", "light"],
            "--minus: `light` is not a field of a stream",
        ),
    ] {
        let asked = measure(&run, &[&of[..], more].concat());
        assert_eq!(asked.code, Some(2), "{asked:?}");
        assert!(asked.err.contains(part), "`{part}` is not in {}", asked.err);
    }
    // a tape alone, and one of another scenario
    let asked = measure(&run.join("tape"), &[&of[..], &["max"]].concat());
    assert_eq!(asked.code, Some(0), "{asked:?}");
    let asked = measure(&run, &["--measures", text(&root().join("examples/lander/lander.toml"))]);
    assert_eq!(asked.code, Some(2), "{asked:?}");
    assert!(
        asked.err.contains("lander.toml:") && asked.err.contains("there is no stream `lander."),
        "{asked:?}"
    );
}

#[test]
fn incomplete_record_is_named() {
    let folder = Folder::new("measures-torn");
    let run = folder.path().join("run");
    let output = run_orchestrator(&["run", text(&springs(&folder)), "--quiet", "--out", text(&run)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    std::fs::remove_file(run.join("tape/seal.json")).unwrap();
    let file = std::fs::OpenOptions::new()
        .write(true)
        .open(run.join("tape/light.motion.bin"))
        .unwrap();
    file.set_len(file.metadata().unwrap().len() - 3).unwrap();
    let asked = measure(&run, &["--of", "light.motion.velocity", "--compute", "min"]);
    assert_eq!(asked.code, Some(0), "{asked:?}");
    let note = "note: stream `light.motion` ends in an incomplete record";
    assert!(asked.err.contains(note), "{asked:?}");
}

#[test]
fn measures_stand_beside_the_assessment() {
    let folder = Folder::new("measures-beside");
    let out = folder.path().join("run");
    let measure = |name: &str| {
        format!(
            "measures.{name}={{ of = \"plant.truth.p_NB_N\", compute = \"rate\", through = \"norm\", at-most = \"1 m/s\" }}"
        )
    };
    let stock = ["run", "scenarios/close.toml", "--in-process", "--json", "--out"];
    let plain = run_orchestrator(&[&stock[..], &[text(&folder.path().join("plain"))]].concat());
    let both = run_orchestrator(&[&stock[..], &[text(&out), "--set", &measure("base-speed")]].concat());
    assert_eq!(both.code, Some(0), "{both:?}");
    let (plain, both) = (plain.json(), both.json());
    assert_eq!(plain["tape_digest"], both["tape_digest"]);
    for (name, value) in plain.as_object().expect("a summary") {
        let machine = ["wall_time_s", "real_time_factor", "timing", "run_folder"];
        if name == "measures" || name == "criteria" {
            continue;
        }
        if !machine.contains(&name.as_str()) {
            assert_eq!(value, &both[name], "{name}");
        }
    }
    for (name, value) in plain["measures"].as_object().expect("it has measures") {
        assert_eq!(value, &both["measures"][name], "{name}");
    }
    let criteria = |summary: &Value| summary["criteria"].as_array().expect("it has criteria").clone();
    let of_base = |criterion: &Value| criterion["name"] == "base-speed";
    let (mut all, own) = (criteria(&both), criteria(&plain));
    assert!(all.iter().any(of_base) && !own.iter().any(of_base));
    all.retain(|criterion| !of_base(criterion));
    assert_eq!(all, own);
    let double = run_orchestrator(&["check", "scenarios/close.toml", "--set", &measure("peak_base_force")]);
    assert_eq!(double.code, Some(2), "{double:?}");
    assert!(double.err.contains("has a figure of that name"), "{double:?}");
}

#[test]
fn faulted_input_can_be_measured() {
    let folder = Folder::new("measures-fault");
    let scenario = folder.write(
        "seen.toml",
        &format!(
            r#"duration = "1 s"
participants.swing = {{ run = {{ exe = "{}" }}, period = "1 ms" }}
participants.brake = {{ run = {{ exe = "{}" }}, period = "10 ms" }}
connections.a = {{ from = "swing.motion", to = "brake.motion" }}
connections.b = {{ from = "brake.push", to = "swing.push" }}

[measures.seen]
of = "brake.seen.motion.position"
minus = "swing.motion.position"
compute = "max-abs"
at-most = "1 m"
"#,
            participant("oscillator").display(),
            participant("damper").display()
        ),
    );
    let run = |fault: &str, name: &str| {
        run_orchestrator(&[
            "run",
            text(&scenario),
            "--fault",
            fault,
            "--out",
            text(&folder.path().join(name)),
        ])
    };
    let bias = run("at=0.5s,input=brake.motion,field=position,kind=bias,value=3m", "bias");
    assert_eq!(bias.code, Some(3), "{bias:?}");
    assert!(
        bias.out.contains("3.00 m (at most 1.00 m): 2.00 m too much at t = 0.5"),
        "{bias:?}"
    );
    // without the fault, the samples seen are not recorded
    let refused = run_orchestrator(&["check", text(&scenario)]);
    let refused = if refused.code == Some(0) {
        run_orchestrator(&["run", text(&scenario), "--out", text(&folder.path().join("no"))])
    } else {
        refused
    };
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.err.contains("there is no stream"), "{refused:?}");
}

#[test]
fn unmeasurable_figure_has_a_reason_and_misses_its_criterion() {
    let folder = Folder::new("measures-none");
    let exe = |name: &str| participant(name).display().to_string();
    let scenario = folder.write(
        "none.toml",
        &format!(
            r#"duration = "1 s"
participants.swing = {{ run = {{ exe = "{oscillator}" }}, period = "1 ms" }}
participants.brake = {{ run = {{ exe = "{damper}" }}, period = "10 ms" }}
participants.late = {{ run = {{ exe = "{damper}" }}, period = "10 ms", offset = "2 s" }}
connections.a = {{ from = "swing.motion", to = ["brake.motion", "late.motion"] }}
connections.b = {{ from = "brake.push", to = "swing.push" }}

[measures]
never = {{ of = "late.push.force", compute = "mean", at-most = "1 N" }}
empty = {{ of = "swing.motion.position", compute = "max", from = "0.5 s", to = "0.5 s", at-least = "-9 m" }}
nothing = {{ of = "swing.motion.position", compute = "max", from = "0.5001 s", to = "0.5009 s", at-least = "-9 m" }}
count = {{ of = "brake.push.count", compute = "final", at-least = 100, at-most = 100 }}
counted = {{ of = "brake.push.count", compute = "changes", at-least = 99, at-most = 99 }}
broken = {{ of = "brake.seen.motion.position", compute = "max-abs", at-most = "9 m" }}
before = {{ of = "brake.seen.motion.position", compute = "max-abs", to = "0.49 s", at-most = "9 m" }}
"#,
            oscillator = exe("oscillator"),
            damper = exe("damper")
        ),
    );
    // Twice the largest double; the brake uses only the velocity.
    let fault = "at=0.5s,input=brake.motion,field=position,kind=scale,value=1e200";
    let out = folder.path().join("run");
    let faults = ["--fault", fault, "--fault", fault];
    let output = run_orchestrator(&[&["run", text(&scenario), "--json", "--out", text(&out)], &faults[..]].concat());
    assert_eq!(output.code, Some(3), "{output:?}");
    let summary = output.json();
    let asked = measure(&out, &["--json"]);
    assert_eq!(asked.code, Some(3), "{asked:?}");
    assert_eq!(results_of(&asked.json())[..3], results_of(&summary)[..3]);
    for (name, reason) in [
        ("never", "there is no sample in the window"),
        ("nothing", "there is no sample in the window"),
        ("broken", "the value is"),
    ] {
        let own = &summary["measures"][name];
        assert_eq!(own["value"], Value::Null, "{own}");
        assert!(own["reason"].as_str().unwrap_or_default().contains(reason), "{own}");
    }
    assert!(
        summary["measures"]["broken"]["reason"]
            .as_str()
            .unwrap()
            .ends_with("inf at t = 0.5 s")
    );
    for name in ["empty", "before", "count", "counted"] {
        assert!(
            summary["measures"][name]["value"].is_number(),
            "{name}: {}",
            summary["measures"][name]
        );
    }
    let criteria = summary["criteria"].as_array().expect("it has criteria");
    let missed = criteria.iter().filter(|one| one["met"] == false);
    let missed: Vec<&str> = missed.map(|one| one["name"].as_str().unwrap_or_default()).collect();
    assert_eq!(missed, ["broken", "never", "nothing"]);
}
