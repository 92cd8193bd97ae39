//! Runs whose scenario leaves samples out of the tape (`[record]`) are resumed, branched, restarted and substituted like others: the
//! checkpoint holds what they need of the missing samples.

use std::path::Path;

use escapement_tests::machine::{signal, wait_for_bytes, writer_of};
use escapement_tests::program::{Folder, Said, finish, orchestrate, participant, root, start, text};
use escapement_tests::samples::{PARTS, samples};
use escapement_tests::world::{World, substitution};
use rustix::process::Signal;
use serde_json::Value;

/// The oscillator with delays, a line between samples, stuck values, a guard and measures, most of which are not on the tape.
fn leaky(name: &str, damper: &str, more: &str) -> World {
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
    let world = World::with(name, damper, &(tables.to_owned() + more));
    let scenario = std::fs::read_to_string(&world.scenario).unwrap();
    let late = scenario
        .replace(
            "to = \"plant.push\"",
            "to = \"plant.push\"\ndelay = \"25 ms\"\njitter = \"12 ms\"\ndrop = 0.3",
        )
        .replace(
            "to = \"damper.motion\"",
            "to = \"damper.motion\"\ndelay = \"47.3 ms\"\nhold = \"linear\"",
        );
    std::fs::write(&world.scenario, late).unwrap();
    world
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
fn same(a: &Path, b: &Path) {
    let said = orchestrate(&["compare", text(a), text(b)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(figures(a), figures(b), "{} and {}", a.display(), b.display());
}

/// Checks that the tape in `part` has the recorded part of the one in `whole`, and that the figures are the same.
fn thinned(whole: &Path, part: &Path) {
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
    let world = leaky("recorded-resumed", "damper", "");
    let path = |name: &str| world.path(name);
    assert_eq!(world.run("plain", &[]).code, Some(0));
    let saves = [
        "--checkpoint-every",
        "2 s",
        "--checkpoint-at",
        "1/3 s",
        "--checkpoint-at",
        "3.777 s",
    ];
    let said = world.run("saved", &saves);
    assert_eq!(said.code, Some(0), "{said:?}");
    same(&path("plain"), &path("saved"));
    assert_eq!(world.run("whole", &[&saves[..], &WHOLE].concat()).code, Some(0));
    thinned(&path("whole"), &path("plain"));
    for from in ["334 ms", "2 s", "3.777 s", "4 s", "8 s"] {
        let said = world.resume("saved", from, &["--from", from, "--checkpoint-at", "9 s"]);
        assert_eq!(said.code, Some(0), "{from}: {said:?}");
        same(&path("plain"), &path(from));
    }
    let said = world.resume("334 ms", "again", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    same(&path("plain"), &path("again"));
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
    assert_eq!(world.resume("whole", "less", &less).code, Some(0));
    assert_eq!(world.resume("less", "least", &[]).code, Some(0));
    for name in ["less", "least"] {
        same(&path("plain"), &path(name));
    }
}

#[test]
fn branch_with_selected_samples_equals_that_of_the_whole_run() {
    let world = leaky("recorded-branch", "damper", "");
    for (name, more) in [("saved", &[][..]), ("whole", &WHOLE)] {
        assert_eq!(
            world.run(name, &[&["--checkpoint-every", "2 s"], more].concat()).code,
            Some(0)
        );
    }
    for (from, change) in [
        ("4 s", "connections.push.delay=10ms"),
        ("4.321 s", "connections.motion.hold=last"),
    ] {
        for run in ["saved", "whole"] {
            let said = world.resume(run, &format!("{run} {from}"), &["--from", from, "--set", change]);
            assert_eq!(said.code, Some(0), "{run} {from}: {said:?}");
        }
        thinned(
            &world.path(&format!("whole {from}")),
            &world.path(&format!("saved {from}")),
        );
        assert_ne!(
            figures(&world.path(&format!("saved {from}"))),
            figures(&world.path("saved"))
        );
    }
    // Limits may change; a measure that would have needed samples which were not recorded cannot.
    let refused = |change: &str, parts: &[&str]| {
        let said = world.resume("saved", "no", &["--from", "4 s", "--set", change]);
        assert_ne!(said.code, Some(0), "{change}: {said:?}");
        for part in parts {
            assert!(said.err.contains(part), "{change}: `{part}` is not in {said:?}");
        }
        let _ = std::fs::remove_dir_all(world.path("no"));
    };
    refused(
        "connections.motion.delay=1.0023 s",
        &["sample #", "of `plant.motion`", "[record]"],
    );
    refused(
        "measures.middle.percent=60",
        &["measure `middle` is new or was changed"],
    );
    refused("guards.moves.frozen-for=2 s", &["guard `moves` is new or was changed"]);
    refused(
        "record.plant.motion={ every = '1 ms', from = '1 s', to = '8 s' }",
        &["keeps more of `plant.motion`"],
    );
    let said = world.resume(
        "saved",
        "limit",
        &["--from", "4 s", "--set", "measures.middle.at-most=5 m"],
    );
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(figures(&world.path("limit")), figures(&world.path("saved")));
}

#[test]
fn restarted_run_with_selected_samples_is_the_same_run() {
    let world = leaky("recorded-restart", "damper", "");
    assert_eq!(world.run("plain", &[]).code, Some(0));
    for who in ["damper", "plant"] {
        let (out, policy) = (
            world.path(who),
            format!("participants.{who}.on-failure=restart-from-checkpoint"),
        );
        let all = [
            "run",
            text(&world.scenario),
            "--out",
            text(&out),
            "--real-time=8",
            "--checkpoint-at",
            "3.6 s",
            "--set",
            &policy,
        ];
        let mut child = start(&all);
        // At 4.5 s of 10, while values are stuck and are not on the tape.
        wait_for_bytes(&mut child, &out.join("tape/plant.motion.bin"), 24 * 700);
        let pid = writer_of(&out.join("log").join(format!("{who}.stderr"))).expect("the participant runs");
        assert!(signal(pid, Signal::KILL));
        let said = finish(child);
        assert_eq!(said.code, Some(0), "{said:?}");
        same(&world.path("plain"), &out);
        assert!(
            world.events(who).contains("from the checkpoint at t = 3600 ms"),
            "{}",
            world.events(who)
        );
    }
}

#[test]
fn substituted_run_with_selected_samples_is_the_same_run() {
    let keep = substitution("2 s", "damper", "keep") + &substitution("4.005 s", "damper", "keep");
    let world = leaky("recorded-kept", "damper", &keep);
    assert_eq!(world.run("run", &["--checkpoint-every", "3 s"]).code, Some(0));
    let other = leaky("recorded-plain", "damper", "");
    assert_eq!(other.run("plain", &[]).code, Some(0));
    same(&other.path("plain"), &world.path("run"));
    assert_eq!(world.resume("run", "resumed", &["--from", "3 s"]).code, Some(0));
    same(&other.path("plain"), &world.path("resumed"));
    // Restarted from the beginning after a failure, the run equals the one that records everything.
    let world = leaky("recorded-crash", "crash_at", "");
    let good = participant("damper").display().to_string();
    let policy = format!("participants.damper.on-failure={{ substitute = {{ exe = {good:?} }} }}");
    for (name, more) in [("part", &[][..]), ("whole", &WHOLE)] {
        let said = world.run(name, &[&["--set", &policy], more].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        assert!(
            world.events(name).contains("takes over at activation 200"),
            "{}",
            world.events(name)
        );
    }
    thinned(&world.path("whole"), &world.path("part"));
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
            &[&["--duration", "1 s"], &PARTS[..]].concat(),
            "peak_base_torque_n_m",
        ),
    ] {
        let out = |way: &str| folder.path().join(format!("{name}-{way}"));
        let told = |said: Said| {
            assert!(matches!(said.code, Some(0 | 3)), "{name}: {said:?}");
            let all = said.json();
            assert!(!all[figure].is_null(), "{all}");
            (all["tape_digest"].clone(), all[figure].clone())
        };
        let run = |way: &str, more: &[&str]| {
            let out = out(way);
            told(orchestrate(
                &[&["run", text(scenario), "--json", "--out", text(&out)], set, more].concat(),
            ))
        };
        let plain = run("plain", &["--in-process"]);
        assert_eq!(run("inside", &["--in-process", "--checkpoint-every", "700 ms"]), plain);
        assert_eq!(run("processes", &["--checkpoint-every", "700 ms"]), plain);
        for (from, to, how) in [("inside", "b", &[][..]), ("processes", "a", &["--in-process"])] {
            let (from, to) = (out(from), out(to));
            let resumed = orchestrate(
                &[
                    &["resume", text(&from), "--json", "--out", text(&to), "--from", "1 s"],
                    how,
                ]
                .concat(),
            );
            assert_eq!(told(resumed), plain, "{name} from {}", from.display());
        }
    }
}
