//! `[record]`: what a scenario keeps of its samples. What is kept is what it always was, figures do not change, runs are taken up like others,
//! and what would need the rest is refused.

use std::collections::BTreeMap;
use std::path::Path;

use escapement_tests::machine::{signal, wait_for_bytes, writer_of};
use escapement_tests::program::{Folder, Said, finish, orchestrate, participant, root, start, text};
use escapement_tests::world::{World, substitution};
use rustix::process::Signal;
use serde_json::Value;
use tape::{Reader, Records, Source};

/// The first seconds of the close capture into `out`.
fn close(out: &Path, more: &[&str]) -> Said {
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
    let said = orchestrate(&[&all[..], more].concat());
    assert!(matches!(said.code, Some(0 | 3)), "{said:?}");
    said
}

/// The samples of each stream by their stamps.
fn samples(run: &Path) -> BTreeMap<String, BTreeMap<u64, Vec<u8>>> {
    let tape = Reader::open(run).expect("there is a tape");
    tape.verify().expect("it is what was sealed");
    let streams = tape.streams().iter().enumerate().map(|(stream, spec)| {
        let mut records = Records::new(&tape, stream);
        let mut samples = BTreeMap::new();
        while let Some(record) = records.next().expect("it can be read") {
            samples.insert(record.stamp_s.to_bits(), record.payload.to_vec());
        }
        (spec.name(), samples)
    });
    streams.collect()
}

const PARTS: [&str; 8] = [
    "--set",
    "record.plant.truth=false",
    "--set",
    "record.plant.measured={ every = \"20 ms\", from = \"0.505 s\", to = \"2 s\" }",
    "--set",
    "record.controller={ command = { to = \"1 s\" } }",
    "--set",
    "record.guidance=true",
];

#[test]
fn what_is_kept_is_what_it_was_in_every_way_of_running() {
    let folder = Folder::new("recorded");
    let out = |name: &str| folder.path().join(name);
    let whole = close(&out("whole"), &["--in-process"]).json();
    let part = close(&out("part"), &[&["--in-process"], &PARTS[..]].concat()).json();
    let apart = close(&out("apart"), &PARTS).json();
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
    // A campaign has the tape of the run.
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
    let swept = orchestrate(&[&common[..], &[text(&out("sweep")), "--vary", "seed=1"], &PARTS].concat());
    assert_eq!(
        swept.json()["rows"][0]["tape_digest"],
        apart["tape_digest"],
        "{swept:?}"
    );
}

#[test]
fn pages_and_exports_show_what_there_is() {
    let folder = Folder::new("recorded-shown");
    let out = folder.path().join("run");
    close(&out, &[&["--in-process"], &PARTS[..]].concat());
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
        let said = orchestrate(command);
        assert_eq!(said.code, Some(0), "{command:?}: {said:?}");
    }
}

#[test]
fn what_needs_the_rest_is_refused() {
    let world = World::with(
        "recorded-refused",
        "damper",
        "\n[record]\nplant.motion = { every = \"5 ms\" }\n\n[measures.peak]\nof = \"plant.motion.position\"\ncompute = \"max\"\n",
    );
    let said = world.run("part", &[]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(
        said.out.contains("the tape has only: `plant.motion` every 5 ms"),
        "{said:?}"
    );
    let part = world.path("part");
    let asked = orchestrate(&["measure", text(&part)]);
    assert_eq!(asked.code, Some(2), "{asked:?}");
    assert!(
        asked.err.contains("measures.peak") && asked.err.contains("[record] leaves samples out"),
        "{asked:?}"
    );
    let replayed = orchestrate(&["replay", text(&part), "--participant", "damper"]);
    assert_eq!(replayed.code, Some(2), "{replayed:?}");
    assert!(replayed.err.contains("5 ms"), "{replayed:?}");
    // What was recorded whole can go on without being so.
    let again = ["--set", "record.plant.motion=true", "--checkpoint-at", "4 s"];
    assert_eq!(world.run("saved", &again).code, Some(0));
    let said = world.resume("saved", "on", &["--set", "record.plant.motion={ every = \"5 ms\" }"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let compared = orchestrate(&["compare", text(&part), text(&world.path("on"))]);
    assert_eq!(compared.code, Some(0), "{compared:?}");
}

#[test]
fn wishes_that_do_not_fit_are_refused_with_file_and_key() {
    let world = World::new("recorded-wrong", "damper");
    let scenario = std::fs::read_to_string(&world.scenario).unwrap();
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
            "no whole multiple of the period",
        ),
        (
            "plant.motion = { every = \"0 s\" }",
            "record.plant.motion.every",
            "above zero",
        ),
        (
            "plant.motion = { from = \"3 s\", to = \"2 s\" }",
            "record.plant.motion.to",
            "nothing would be kept",
        ),
        (
            "plant.motion = { until = \"2 s\" }",
            "record.plant.motion",
            "unknown field `until`",
        ),
        ("plant.motion = 5", "record.plant.motion", "write false, true"),
    ] {
        std::fs::write(&world.scenario, format!("{scenario}\n[record]\n{record}\n")).unwrap();
        let said = world.run("no", &[]);
        assert_eq!(said.code, Some(2), "{record}: {said:?}");
        assert!(said.err.contains(key) && said.err.contains(part), "{record}: {said:?}");
        assert!(!world.path("no").exists());
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
    let said = orchestrate(&[&["export", text(&out), "--to", "csv", "--out", text(&to)], &chosen[..]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
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
    let said = orchestrate(&["export", text(&out), "--to", "csv", "--of", "plant.truth.nope"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("has no field `nope`"), "{said:?}");
    // What the file is of stands in it.
    let said = orchestrate(&[
        "export",
        text(&out),
        "--to",
        "mcap",
        "--compression",
        "none",
        "--out",
        text(&to),
    ]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let mcap = std::fs::read(to.join("run.mcap")).unwrap();
    let has = |part: &str| mcap.windows(part.len()).any(|window| window == part.as_bytes());
    assert!(has(summary["tape_digest"].as_str().unwrap()) && has("[participants.plant]"));
    let plain = mcap.len();
    let said = orchestrate(&["export", text(&out), "--to", "mcap", "--out", text(&to)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let packed = std::fs::metadata(to.join("run.mcap")).unwrap().len() as usize;
    assert!(packed < plain, "{packed} of {plain}");
}

/// The oscillator with delays, a line between samples, values that stick, a guard and measures, most of which the tape does not have.
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

/// Everything is kept.
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

/// Both runs have the same tape and the same figures.
fn same(a: &Path, b: &Path) {
    let said = orchestrate(&["compare", text(a), text(b)]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(figures(a), figures(b), "{} and {}", a.display(), b.display());
}

/// The tape in `part` has what the one in `whole` has, as far as it is kept, and the figures are the same.
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
fn resumed_without_the_rest_it_is_the_same_run() {
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
    // What went on from a tape with everything on it keeps less, and can be gone on from as well.
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
fn branch_without_the_rest_is_the_branch_of_the_whole_run() {
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
    // Limits may change; what would have needed samples that nobody has cannot.
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
fn restarted_without_the_rest_it_is_the_same_run() {
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
        // At 4.5 s of 10, while values stick and are not on the tape.
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
fn substituted_without_the_rest_it_is_the_same_run() {
    let keep = substitution("2 s", "damper", "keep") + &substitution("4.005 s", "damper", "keep");
    let world = leaky("recorded-kept", "damper", &keep);
    assert_eq!(world.run("run", &["--checkpoint-every", "3 s"]).code, Some(0));
    let other = leaky("recorded-plain", "damper", "");
    assert_eq!(other.run("plain", &[]).code, Some(0));
    same(&other.path("plain"), &world.path("run"));
    assert_eq!(world.resume("run", "resumed", &["--from", "3 s"]).code, Some(0));
    same(&other.path("plain"), &world.path("resumed"));
    // From afresh, after a failure, it is what the run that keeps everything has.
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

/// Two masses of the program's own, of which nothing and a window is kept; and a capture with figures of its own.
#[test]
fn builtins_are_taken_up_without_the_rest_in_both_ways() {
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
