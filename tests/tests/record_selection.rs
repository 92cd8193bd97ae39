//! `[record]`: the samples that a scenario records. The recorded samples are unchanged, figures do not change, and what needs the other
//! samples is rejected.

use std::path::Path;

use escapement_tests::fixture::RunFixture;
use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};
use escapement_tests::samples::{PARTIAL_RECORD, samples};
use serde_json::Value;

/// The first seconds of the close capture into `out`.
fn close(out: &Path, more: &[&str]) -> ProgramOutput {
    let scenario = root().join("scenarios/close.toml");
    let all = [
        "run",
        text(&scenario),
        "--duration",
        "3 s",
        "--json",
        "--out",
        text(out),
    ];
    let output = run_orchestrator(&[&all[..], more].concat());
    assert!(matches!(output.code, Some(0 | 3)), "{output:?}");
    output
}

#[test]
fn selected_samples_equal_the_whole_tape_in_every_way() {
    let folder = Folder::new("recorded");
    let out = |name: &str| folder.path().join(name);
    let whole = close(&out("whole"), &["--in-process"]).json();
    let part = close(&out("part"), &[&["--in-process"], &PARTIAL_RECORD[..]].concat()).json();
    let apart = close(&out("apart"), &PARTIAL_RECORD).json();
    assert_ne!(
        whole["tape_digest"], part["tape_digest"],
        "the digest says what it covers"
    );
    assert_eq!(part["tape_digest"], apart["tape_digest"]);
    for key in ["criteria", "peak_base_torque_n_m", "verdict"] {
        assert_eq!(whole[key], part[key], "{key}");
    }
    assert!(whole["tape_has_only"].is_null());
    let words = part["tape_has_only"].to_string();
    for part in [
        "nothing of `plant.truth`",
        "`plant.measured` every 20 ms from 520 ms to 2 s",
        "`controller.command` to 1 s",
    ] {
        assert!(words.contains(part), "{words}");
    }
    let (whole, part) = (samples(&out("whole")), samples(&out("part")));
    let missing: Vec<&String> = whole.keys().filter(|name| !part.contains_key(*name)).collect();
    assert_eq!(missing, ["plant.truth"]);
    let instants =
        |times: &mut dyn Iterator<Item = u32>| times.map(|ms| (f64::from(ms) / 1000.0).to_bits()).collect::<Vec<_>>();
    let stamps = |name: &str| part[name].keys().copied().collect::<Vec<_>>();
    assert_eq!(stamps("plant.measured"), instants(&mut (520..=2000).step_by(20)));
    assert_eq!(stamps("controller.command"), instants(&mut (0..=1000).step_by(10)));
    assert_eq!(part["guidance.setpoint"], whole["guidance.setpoint"]);
    for (name, kept) in &part {
        for (stamp, payload) in kept {
            assert_eq!(whole[name][stamp], *payload, "{name} at {}", f64::from_bits(*stamp));
        }
    }
    // A campaign has the same tape as the run.
    let scenario = root().join("scenarios/close.toml");
    let common = [
        "sweep",
        text(&scenario),
        "--duration",
        "3 s",
        "--json",
        "--digest",
        "--out",
    ];
    let swept = run_orchestrator(&[&common[..], &[text(&out("sweep")), "--vary", "seed=1"], &PARTIAL_RECORD].concat());
    assert_eq!(
        swept.json()["rows"][0]["tape_digest"],
        apart["tape_digest"],
        "{swept:?}"
    );
}

#[test]
fn pages_and_exports_show_the_recorded_samples() {
    let folder = Folder::new("recorded-shown");
    let out = folder.path().join("run");
    close(&out, &[&["--in-process"], &PARTIAL_RECORD[..]].concat());
    for command in [
        &["report", text(&out)][..],
        &["export", text(&out), "--to", "parquet"],
        &["export", text(&out), "--to", "mcap"],
        &["compare", text(&out), text(&out)],
        &[
            "measure",
            text(&out),
            "--of",
            "plant.measured.p_NB_N[0]",
            "--compute",
            "max",
            "--json",
        ],
    ] {
        let output = run_orchestrator(command);
        assert_eq!(output.code, Some(0), "{command:?}: {output:?}");
    }
}

#[test]
fn commands_that_need_unrecorded_samples_are_refused() {
    let fixture = RunFixture::with_appended(
        "recorded-refused",
        "damper",
        "\n[record]\nplant.motion = { every = \"5 ms\" }\n\n[measures.peak]\nof = \"plant.motion.position\"\ncompute = \"max\"\n",
    );
    let output = fixture.run("part", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.out.contains("the tape has only: `plant.motion` every 5 ms"),
        "{output:?}"
    );
    let part = fixture.path("part");
    let asked = run_orchestrator(&["measure", text(&part)]);
    assert_eq!(asked.code, Some(2), "{asked:?}");
    assert!(
        asked.err.contains("measures.peak") && asked.err.contains("[record] leaves samples out"),
        "{asked:?}"
    );
    let replayed = run_orchestrator(&["replay", text(&part), "--participant", "damper"]);
    assert_eq!(replayed.code, Some(2), "{replayed:?}");
    let words = "`record` leaves out samples of `plant.motion`";
    assert!(replayed.err.contains(words), "{replayed:?}");
    // A run that was recorded completely can continue with a partial record.
    let again = ["--set", "record.plant.motion=true", "--checkpoint-at", "4 s"];
    assert_eq!(fixture.run("saved", &again).code, Some(0));
    let output = fixture.resume("saved", "on", &["--set", "record.plant.motion={ every = \"5 ms\" }"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let compared = run_orchestrator(&["compare", text(&part), text(&fixture.path("on"))]);
    assert_eq!(compared.code, Some(0), "{compared:?}");
}

#[test]
fn entries_that_do_not_fit_are_refused_with_file_and_key() {
    let fixture = RunFixture::new("recorded-wrong", "damper");
    let scenario = std::fs::read_to_string(&fixture.scenario).unwrap();
    for (record, key, part) in [
        (
            "plants.motion = false",
            "record.plants",
            "there is no participant `plants`",
        ),
        (
            "plant.notion = false",
            "record.plant.notion",
            "there is no output `notion`; there is `motion`",
        ),
        (
            "plant.motion = { every = \"2.5 ms\" }",
            "record.plant.motion.every",
            "is not a whole multiple of the period",
        ),
        (
            "plant.motion = { every = \"0 s\" }",
            "record.plant.motion.every",
            "above zero",
        ),
        (
            "plant.motion = { from = \"3 s\", to = \"2 s\" }",
            "record.plant.motion.to",
            "nothing would be recorded",
        ),
        (
            "plant.motion = { until = \"2 s\" }",
            "record.plant.motion",
            "unknown field `until`",
        ),
        ("plant.motion = 5", "record.plant.motion", "write false, true"),
    ] {
        std::fs::write(&fixture.scenario, format!("{scenario}\n[record]\n{record}\n")).unwrap();
        let output = fixture.run("no", &[]);
        assert_eq!(output.code, Some(2), "{record}: {output:?}");
        assert!(
            output.err.contains(key) && output.err.contains(part),
            "{record}: {output:?}"
        );
        assert!(!fixture.path("no").exists());
    }
}

#[test]
fn exports_choose_streams_fields_and_times() {
    let folder = Folder::new("chosen");
    let out = folder.path().join("run");
    let summary: Value = close(&out, &["--in-process"]).json();
    let to = folder.path().join("csv");
    let chosen = [
        "--of",
        "plant.truth.p_NB_N",
        "--of",
        "guidance.setpoint",
        "--from",
        "0.5s",
        "--until",
        "0.75s",
    ];
    let output = run_orchestrator(&[&["export", text(&out), "--to", "csv", "--out", text(&to)], &chosen[..]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let files: Vec<String> = std::fs::read_dir(&to)
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(files.len(), 2, "{files:?}");
    let table = std::fs::read_to_string(to.join("plant.truth.csv")).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("t [s],p_NB_N[0] [m],p_NB_N[1] [m],p_NB_N[2] [m]"));
    let stamps: Vec<f64> = lines
        .map(|line| line.split(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(
        (stamps.len(), stamps.first(), stamps.last()),
        (251, Some(&0.5), Some(&0.75))
    );
    let output = run_orchestrator(&["export", text(&out), "--to", "csv", "--of", "plant.truth.nope"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("has no field `nope`"), "{output:?}");
    // Options of other formats are refused, not ignored.
    for (option, value) in [("--compression", "none"), ("--model", "nobody=none.urdf")] {
        let output = run_orchestrator(&["export", text(&out), "--to", "csv", option, value]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(&format!("error: {option}: only")), "{output:?}");
    }
    // The file contains the digest of its tape and its scenario.
    let output = run_orchestrator(&[
        "export",
        text(&out),
        "--to",
        "mcap",
        "--compression",
        "none",
        "--out",
        text(&to),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let mcap = std::fs::read(to.join("run.mcap")).unwrap();
    let has = |part: &str| mcap.windows(part.len()).any(|window| window == part.as_bytes());
    assert!(has(summary["tape_digest"].as_str().unwrap()) && has("[participants.plant]"));
    let plain = mcap.len();
    let output = run_orchestrator(&["export", text(&out), "--to", "mcap", "--out", text(&to)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let packed = std::fs::metadata(to.join("run.mcap")).unwrap().len() as usize;
    assert!(packed < plain, "{packed} of {plain}");
}

#[test]
fn measure_names_the_stream_that_the_tape_lacks() {
    let folder = Folder::new("recorded-nothing");
    let (nothing, part) = (folder.path().join("nothing"), folder.path().join("part"));
    let off = ["record.plant=false", "record.controller=false", "record.guidance=false"];
    let off: Vec<&str> = off.iter().flat_map(|one| ["--set", one]).collect();
    close(&nothing, &[&["--in-process"], &off[..]].concat());
    close(&part, &[&["--in-process"], &off[..2]].concat());
    let of = ["--of", "plant.truth.relative_speed", "--compute", "max"];
    for (run, output) in [
        (&nothing, "nothing: the tape has no stream, so nothing can be measured"),
        (&part, "--of: there is no stream `plant.truth`; there is `controller."),
        (&part, "if [record] leaves its stream out"),
    ] {
        let asked = run_orchestrator(&[&["measure", text(run)], &of[..]].concat());
        assert_eq!(asked.code, Some(2), "{asked:?}");
        assert!(asked.err.contains(output), "`{output}` is not in {}", asked.err);
    }
}

#[test]
fn window_after_the_end_causes_a_warning() {
    for (from, warned) in [("5 s", true), ("1 s", false)] {
        let record = format!("record.plant.truth={{ from = \"{from}\" }}");
        let output = run_orchestrator(&[
            "check",
            text(&root().join("scenarios/close.toml")),
            "--set",
            "duration=2 s",
            "--set",
            &record,
        ]);
        assert_eq!(output.code, Some(0), "{output:?}");
        let warning = "record.plant.truth.from: 5 s is after the end at 2 s: nothing is recorded of it";
        assert_eq!(
            output.err.contains(warning) || output.out.contains(warning),
            warned,
            "{output:?}"
        );
    }
}
