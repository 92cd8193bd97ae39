//! Runs whose scenario leaves samples out of the tape (`[record]`) are resumed, branched, restarted and substituted like others: the
//! checkpoint holds what they need of the missing samples.

use std::path::Path;

use escapement_tests::fixture::{RunFixture, substitution};
use escapement_tests::machine::{send_signal, wait_for_bytes, writer_of};
use escapement_tests::program::{
    Folder, ProgramOutput, participant, root, run_orchestrator, start_orchestrator, text, wait_for_output,
};
use escapement_tests::samples::{PARTIAL_RECORD, samples};
use rustix::process::Signal;
use serde_json::Value;

/// The oscillator with delays, a line between samples, stuck values, a guard and measures, most of which are not on the tape.
fn fixture_with_selection(name: &str, damper: &str, more: &str) -> RunFixture {
    let tables = r#"
[record]
plant.motion = { every = "5 ms", from = "1 s", to = "8 s" }
damper.push = false
damper.seen.motion = { every = "30 ms" }

[guards.moves]
output = "plant.motion"
field = "velocity"
frozen-for = "100 ms"

[measures.middle]
of = "plant.motion.position"
compute = "percentile"
percent = 50

[measures.pushed]
of = "damper.push.force"
compute = "integral-abs"

[measures.seen]
of = "plant.motion.velocity"
minus = "damper.seen.motion.velocity"
compute = "rms"

[[faults]]
name = "sticks"
at = "3.5 s"
until = "6 s"
output = "plant.motion"
field = "position"
kind = "stuck"

[[faults]]
name = "same"
at = "1.7 s"
until = "4.4 s"
input = "damper.motion"
field = "velocity"
kind = "stuck"
"#;
    let fixture = RunFixture::with_appended(name, damper, &(tables.to_owned() + more));
    let scenario = std::fs::read_to_string(&fixture.scenario).unwrap();
    let late = scenario
        .replace(
            "to = \"plant.push\"",
            "to = \"plant.push\"\ndelay = \"25 ms\"\njitter = \"12 ms\"\ndrop = 0.3",
        )
        .replace(
            "to = \"damper.motion\"",
            "to = \"damper.motion\"\ndelay = \"47.3 ms\"\nhold = \"linear\"",
        );
    std::fs::write(&fixture.scenario, late).unwrap();
    fixture
}

/// Everything is recorded.
const WHOLE: [&str; 6] = [
    "--set",
    "record.plant.motion=true",
    "--set",
    "record.damper.push=true",
    "--set",
    "record.damper.seen.motion=true",
];

fn figures(run: &Path) -> Value {
    let summary = std::fs::read(run.join("summary.json")).expect("there is a summary");
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    assert!(summary["measures"].is_object(), "{summary}");
    summary["measures"].clone()
}

/// Checks that both runs have the same tape and the same figures.
fn assert_same_tape(a: &Path, b: &Path) {
    let output = run_orchestrator(&["compare", text(a), text(b)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(figures(a), figures(b), "{} and {}", a.display(), b.display());
}

/// Checks that the tape in `part` has the recorded part of the one in `whole`, and that the figures are the same.
fn assert_selected_part(whole: &Path, part: &Path) {
    assert_eq!(figures(whole), figures(part), "{}", part.display());
    let (whole, part) = (samples(whole), samples(part));
    assert_eq!(part["plant.motion"].len(), 1401);
    assert!(part.len() == 2 && whole.len() == 3, "{:?}", part.keys());
    for (name, kept) in &part {
        for (stamp, payload) in kept {
            assert_eq!(whole[name][stamp], *payload, "{name} at {}", f64::from_bits(*stamp));
        }
    }
}

#[test]
fn resumed_run_with_selected_samples_is_the_same_run() {
    let fixture = fixture_with_selection("recorded-resumed", "damper", "");
    let path = |name: &str| fixture.path(name);
    assert_eq!(fixture.run("plain", &[]).code, Some(0));
    let saves = [
        "--checkpoint-every",
        "2 s",
        "--checkpoint-at",
        "1/3 s",
        "--checkpoint-at",
        "3.777 s",
    ];
    let output = fixture.run("saved", &saves);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_same_tape(&path("plain"), &path("saved"));
    assert_eq!(fixture.run("whole", &[&saves[..], &WHOLE].concat()).code, Some(0));
    assert_selected_part(&path("whole"), &path("plain"));
    for from in ["334 ms", "2 s", "3.777 s", "4 s", "8 s"] {
        let output = fixture.resume("saved", from, &["--from", from, "--checkpoint-at", "9 s"]);
        assert_eq!(output.code, Some(0), "{from}: {output:?}");
        assert_same_tape(&path("plain"), &path(from));
    }
    let output = fixture.resume("334 ms", "again", &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_same_tape(&path("plain"), &path("again"));
    // A run that continues from a complete tape may record less, and can be continued as well.
    let less = [
        "--set",
        "record.plant.motion={ every = '5 ms', from = '1 s', to = '8 s' }",
        "--set",
        "record.damper.push=false",
        "--set",
        "record.damper.seen.motion={ every = '30 ms' }",
        "--from",
        "4 s",
        "--checkpoint-at",
        "5 s",
    ];
    assert_eq!(fixture.resume("whole", "less", &less).code, Some(0));
    assert_eq!(fixture.resume("less", "least", &[]).code, Some(0));
    for name in ["less", "least"] {
        assert_same_tape(&path("plain"), &path(name));
    }
}

#[test]
fn branch_with_selected_samples_equals_that_of_the_whole_run() {
    let fixture = fixture_with_selection("recorded-branch", "damper", "");
    for (name, more) in [("saved", &[][..]), ("whole", &WHOLE)] {
        assert_eq!(
            fixture.run(name, &[&["--checkpoint-every", "2 s"], more].concat()).code,
            Some(0)
        );
    }
    for (from, change) in [
        ("4 s", "connections.push.delay=10ms"),
        ("4.321 s", "connections.motion.hold=last"),
    ] {
        for run in ["saved", "whole"] {
            let output = fixture.resume(run, &format!("{run} {from}"), &["--from", from, "--set", change]);
            assert_eq!(output.code, Some(0), "{run} {from}: {output:?}");
        }
        assert_selected_part(
            &fixture.path(&format!("whole {from}")),
            &fixture.path(&format!("saved {from}")),
        );
        assert_ne!(
            figures(&fixture.path(&format!("saved {from}"))),
            figures(&fixture.path("saved"))
        );
    }
    // Limits may change; a measure that would have needed samples which were not recorded cannot.
    let assert_refused = |change: &str, parts: &[&str]| {
        let output = fixture.resume("saved", "no", &["--from", "4 s", "--set", change]);
        assert_ne!(output.code, Some(0), "{change}: {output:?}");
        for part in parts {
            assert!(output.err.contains(part), "{change}: `{part}` is not in {output:?}");
        }
        let _ = std::fs::remove_dir_all(fixture.path("no"));
    };
    assert_refused(
        "connections.motion.delay=1.0023 s",
        &["sample #", "of `plant.motion`", "[record]"],
    );
    assert_refused(
        "measures.middle.percent=60",
        &["measure `middle` is new or was changed"],
    );
    assert_refused("guards.moves.frozen-for=2 s", &["guard `moves` is new or was changed"]);
    assert_refused(
        "record.plant.motion={ every = '1 ms', from = '1 s', to = '8 s' }",
        &["keeps more of `plant.motion`"],
    );
    let output = fixture.resume(
        "saved",
        "limit",
        &["--from", "4 s", "--set", "measures.middle.at-most=5 m"],
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(figures(&fixture.path("limit")), figures(&fixture.path("saved")));
}

#[test]
fn restarted_run_with_selected_samples_is_the_same_run() {
    let fixture = fixture_with_selection("recorded-restart", "damper", "");
    assert_eq!(fixture.run("plain", &[]).code, Some(0));
    for participant_name in ["damper", "plant"] {
        let (out, policy) = (
            fixture.path(participant_name),
            format!("participants.{participant_name}.on-failure=restart-from-checkpoint"),
        );
        let all = [
            "run",
            text(&fixture.scenario),
            "--out",
            text(&out),
            "--real-time=8",
            "--checkpoint-at",
            "3.6 s",
            "--set",
            &policy,
        ];
        let mut child = start_orchestrator(&all);
        // At 4.5 s of 10, while values are stuck and are not on the tape.
        wait_for_bytes(&mut child, &out.join("tape/plant.motion.bin"), 24 * 700);
        let pid = writer_of(&out.join("log").join(format!("{participant_name}.stderr"))).expect("the participant runs");
        assert!(send_signal(pid, Signal::KILL));
        let output = wait_for_output(child);
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_same_tape(&fixture.path("plain"), &out);
        assert!(
            fixture
                .events(participant_name)
                .contains("from the checkpoint at t = 3600 ms"),
            "{}",
            fixture.events(participant_name)
        );
    }
}

#[test]
fn substituted_run_with_selected_samples_is_the_same_run() {
    let keep = substitution("2 s", "damper", "keep") + &substitution("4.005 s", "damper", "keep");
    let fixture = fixture_with_selection("recorded-kept", "damper", &keep);
    assert_eq!(fixture.run("run", &["--checkpoint-every", "3 s"]).code, Some(0));
    let other = fixture_with_selection("recorded-plain", "damper", "");
    assert_eq!(other.run("plain", &[]).code, Some(0));
    assert_same_tape(&other.path("plain"), &fixture.path("run"));
    assert_eq!(fixture.resume("run", "resumed", &["--from", "3 s"]).code, Some(0));
    assert_same_tape(&other.path("plain"), &fixture.path("resumed"));
    // Restarted from the beginning after a failure, the run equals the one that records everything.
    let fixture = fixture_with_selection("recorded-crash", "crash_at", "");
    let good = participant("damper").display().to_string();
    let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {good:?} }} }}");
    for (name, more) in [("part", &[][..]), ("whole", &WHOLE)] {
        let output = fixture.run(name, &[&["--set", &policy], more].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        assert!(
            fixture.events(name).contains("takes over at activation 200"),
            "{}",
            fixture.events(name)
        );
    }
    assert_selected_part(&fixture.path("whole"), &fixture.path("part"));
}

/// Two masses of the stock program, of which nothing and a window are recorded, respectively; and a capture, with its own figures.
#[test]
fn builtins_with_selected_samples_are_resumed_in_both_ways() {
    let folder = Folder::new("recorded-builtins");
    let stock = std::fs::read_to_string(root().join("orchestrator/src/templates/spring.toml")).unwrap();
    let more = "\n[record]\nleft = false\nright.motion = { every = \"50 ms\", to = \"2 s\" }\n\n\
                [measures.swing]\nof = \"left.motion.position\"\nminus = \"right.motion.position\"\ncompute = \"max-abs\"\n\n\
                [[faults]]\nat = \"1.2 s\"\nsubstitute = \"right\"\nrun = { builtin = \"spring\" }\nstate = \"cold\"\n";
    let springs = folder.write("springs.toml", &(stock.replace("\"10 s\"", "\"3 s\"") + more));
    let close = root().join("scenarios/close.toml");
    for (name, scenario, set, figure) in [
        ("springs", &springs, &[][..], "measures"),
        (
            "close",
            &close,
            &[&["--duration", "1 s"], &PARTIAL_RECORD[..]].concat(),
            "peak_base_torque_n_m",
        ),
    ] {
        let out = |way: &str| folder.path().join(format!("{name}-{way}"));
        let results_of = |output: ProgramOutput| {
            assert!(matches!(output.code, Some(0 | 3)), "{name}: {output:?}");
            let all = output.json();
            assert!(!all[figure].is_null(), "{all}");
            (all["tape_digest"].clone(), all[figure].clone())
        };
        let run = |way: &str, more: &[&str]| {
            let out = out(way);
            results_of(run_orchestrator(
                &[&["run", text(scenario), "--json", "--out", text(&out)], set, more].concat(),
            ))
        };
        let plain = run("plain", &["--in-process"]);
        assert_eq!(run("inside", &["--in-process", "--checkpoint-every", "700 ms"]), plain);
        assert_eq!(run("processes", &["--checkpoint-every", "700 ms"]), plain);
        for (from, to, how) in [("inside", "b", &[][..]), ("processes", "a", &["--in-process"])] {
            let (from, to) = (out(from), out(to));
            let resumed = run_orchestrator(
                &[
                    &["resume", text(&from), "--json", "--out", text(&to), "--from", "1 s"],
                    how,
                ]
                .concat(),
            );
            assert_eq!(results_of(resumed), plain, "{name} from {}", from.display());
        }
    }
}
