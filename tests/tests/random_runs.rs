//! Random plans with substitutions, declared faults, guards, measures, checkpoints and partial tapes yield one tape: in one loop with a
//! folder, in memory with pauses and restores, without a tape, in processes, and resumed from a checkpoint.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use engine::Catalogue;
use engine::run::{self, Ending, Options, Origin, Outcome, Record, Run, checkpoint};
use engine::scenario::Scenario;
use escapement_tests::participants::{Damper, Oscillator};
use escapement_tests::program::{Folder, participant};
use lockstep::random::Stream;
use lockstep::time::Rational;

/// Consecutive random samples for one plan.
struct Rng(Stream, u64);

impl Rng {
    fn below(&mut self, count: u64) -> u64 {
        self.1 += 1;
        self.0.bits(self.1) % count
    }

    fn choose<'a>(&mut self, all: &[&'a str]) -> &'a str {
        all[self.below(all.len() as u64) as usize]
    }
}

/// The value of `run =` for a participant.
fn program(name: &str, processes: bool) -> String {
    if processes {
        format!("{{ exe = \"{}\" }}", participant(name).display())
    } else {
        format!("{{ builtin = \"{name}\" }}")
    }
}

/// A chain of an oscillator and dampers, of which the first pushes it, with all kinds of random events.
fn plan(rng: &mut Rng, processes: bool) -> String {
    let dampers = 1 + rng.below(3);
    let mut text = format!("duration = \"300 ms\"\nseed = {}\n", rng.below(1000));
    let _ = write!(
        text,
        "[participants.plant]\nrun = {}\nperiod = \"{}\"\n",
        program("oscillator", processes),
        rng.choose(&["1 ms", "2 ms", "1/300 s"])
    );
    for number in 0..dampers {
        let _ = write!(
            text,
            "[participants.damper-{number}]\nrun = {}\nperiod = \"{}\"\noffset = \"{}\"\n[connections.to-{number}]\n\
             from = \"plant.motion\"\nto = \"damper-{number}.motion\"\ndelay = \"{}\"\njitter = \"{}\"\ndrop = {}\nhold = \"{}\"\n",
            program("damper", processes),
            rng.choose(&["3 ms", "10 ms", "7 ms", "1/70 s"]),
            rng.choose(&["0 s", "0 s", "4 ms", "95 ms"]),
            rng.choose(&["0 s", "5 ms", "21 ms"]),
            rng.choose(&["0 s", "0 s", "9 ms"]),
            rng.choose(&["0.0", "0.0", "0.4"]),
            rng.choose(&["last", "initial", "linear"]),
        );
        if rng.below(2) == 0 {
            // The two fields on separate links.
            let _ = write!(
                text,
                "map = {{ velocity = \"velocity\" }}\n[connections.place-{number}]\nfrom = \"plant.motion.position\"\n\
                 to = \"damper-{number}.motion.position\"\nfactor = {}\ndelay = \"{}\"\n",
                rng.choose(&["1", "-2.5"]),
                rng.choose(&["0 s", "2 ms", "33 ms"]),
            );
        }
    }
    let _ = write!(
        text,
        "[connections.push]\nfrom = \"damper-0.push\"\nto = \"plant.push\"\ndelay = \"{}\"\n",
        rng.choose(&["0 s", "1 ms", "30 ms"])
    );
    let _ = write!(
        text,
        "[guards.wide]\noutput = \"plant.motion\"\nfield = \"position\"\nrange = \"[-100, 100] m\"\n\
         [guards.moves]\noutput = \"plant.motion\"\nfield = \"velocity\"\nfrozen-for = \"100 ms\"\n"
    );
    for fault in 0..rng.below(4) {
        let (at, until) = (rng.below(250), 10 + rng.below(100));
        let _ = write!(
            text,
            "[[faults]]\nname = \"odd-{fault}\"\nat = \"{at} ms\"\nuntil = \"{} ms\"\n{}\n",
            at + until,
            rng.choose(&[
                "output = \"plant.motion\"\nfield = \"velocity\"\nkind = \"noise\"\nvalue = \"0.1 m/s\"",
                "output = \"plant.motion\"\nfield = \"position\"\nkind = \"stuck\"",
                "input = \"damper-0.motion\"\nfield = \"velocity\"\nkind = \"bias\"\nvalue = \"0.3 m/s\"",
                "input = \"plant.push\"\nfield = \"force\"\nkind = \"stuck\"",
                "connection = \"push\"\nextra-delay = \"17 ms\"",
                "connection = \"to-0\"\ndrop = 0.7",
            ])
        );
    }
    for _ in 0..2 + rng.below(5) {
        // Not always at an activation, often at one shared with other participants, and several for one participant.
        let at = rng.choose(&["0 s", "2 ms", "30 ms", "30 ms", "95 ms", "1/7 s", "210 ms", "277 ms"]);
        let (slot, name) = match rng.below(3) {
            0 => ("plant".to_owned(), "oscillator"),
            1 => ("damper-0".to_owned(), "damper"),
            _ => (format!("damper-{}", rng.below(dampers)), "damper"),
        };
        let _ = write!(
            text,
            "[[faults]]\nat = \"{at}\"\nsubstitute = \"{slot}\"\nrun = {}\nstate = \"{}\"\n",
            program(name, processes),
            rng.choose(&["cold", "keep"])
        );
    }
    text + "[measures.away]\nof = \"plant.motion.position\"\ncompute = \"mean\"\n\
            [measures.apart]\nof = \"plant.motion.velocity\"\nminus = \"plant.motion.velocity\"\ncompute = \"rms\"\n\
            [measures.pushes]\nof = \"damper-0.push.count\"\ncompute = \"max\"\n"
}

/// The part of the samples that is recorded; one plan in four records everything.
fn record(rng: &mut Rng) -> String {
    let part = |of: &str, part: &str| format!("{of} = {part}\n");
    let every = [
        "false",
        "true",
        "{ from = \"40 ms\", to = \"120 ms\" }",
        "{ to = \"100 ms\" }",
        "{ from = \"220 ms\" }",
    ];
    match rng.below(4) {
        0 => String::new(),
        1 => "[record]\nplant = false\ndamper-0 = false\n".to_owned(),
        _ => {
            let (motion, push) = (rng.choose(&every), rng.choose(&every));
            "[record]\n".to_owned() + &part("plant.motion", motion) + &part("damper-0.push", push)
        }
    }
}

fn scenario(seed: u64, processes: bool) -> Scenario {
    let catalogue = Catalogue::new("tests")
        .participant("oscillator", Oscillator::factory)
        .participant("damper", Damper::factory);
    let text = plan(&mut Rng(Stream::new(seed, "random runs"), 0), processes)
        + &record(&mut Rng(Stream::new(seed, "what is kept"), 0));
    let read = Scenario::read_text(&Arc::new(catalogue), Path::new("random.toml"), &text);
    read.unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The digest of the tape, and the figures.
fn digest(outcome: Outcome, way: &str) -> String {
    assert_eq!(outcome.ending, Ending::Complete, "{way}");
    let figures = outcome.figures.expect("there are measures").json();
    format!("{} {figures:?}", outcome.digest.expect("a digest"))
}

/// Options for a run in `out`, with two checkpoints.
fn recorded(out: &Path, in_process: bool) -> Options {
    Options {
        in_process,
        out: Some(out.to_owned()),
        checkpoint_at: vec![Rational::from_millis(33), Rational::from_millis(201)],
        ..Options::default()
    }
}

#[test]
fn any_plan_gives_one_tape_however_it_is_executed() {
    let folder = Folder::new("random");
    let mut tapes = HashSet::new();
    for seed in 0..12 {
        let out = |way: &str| folder.path().join(format!("{seed}-{way}"));
        let ran = |scenario: &Scenario, options: &Options, way: &str| {
            let outcome = run::run(scenario, options).unwrap_or_else(|error| panic!("{seed} {way}: {error}"));
            digest(outcome, &format!("{seed} {way}"))
        };
        let (inside, outside) = (scenario(seed, false), scenario(seed, true));
        let whole = ran(&inside, &recorded(&out("inside"), true), "inside");
        let bare = Options {
            in_process: true,
            record: Record::Digest,
            ..Options::default()
        };
        assert_eq!(ran(&inside, &bare, "digest"), whole, "{seed} without a tape");
        assert_eq!(
            ran(&outside, &recorded(&out("outside"), false), "outside"),
            whole,
            "{seed} in processes"
        );
        assert_eq!(
            digest_with_pauses(&inside, seed),
            whole,
            "{seed} with rests and a way back"
        );
        for (at, in_process) in [(50, true), (250, false), (250, true)] {
            let saved = out(if in_process { "inside" } else { "outside" });
            let limit = Some(Rational::from_millis(at));
            let (checkpoint, _) = checkpoint::Checkpoint::find(&saved.join("checkpoints"), limit).unwrap();
            let options = Options {
                in_process,
                out: Some(out(&format!("resumed-{at}-{in_process}"))),
                origin: Some(Origin { run: saved, checkpoint }),
                ..Options::default()
            };
            let resumed = if in_process { &inside } else { &outside };
            assert_eq!(
                ran(resumed, &options, "resumed"),
                whole,
                "{seed} resumed at {at} ms, {in_process}"
            );
        }
        tapes.insert(whole);
    }
    assert_eq!(tapes.len(), 12, "what happens shows on the tape");
}

/// The tape of a run in memory that is paused at several instants and restored twice.
fn digest_with_pauses(scenario: &Scenario, seed: u64) -> String {
    let options = Options {
        in_process: true,
        record: Record::Memory,
        ..Options::default()
    };
    let mut rng = Rng(Stream::new(seed, "rests"), 0);
    let mut run = Run::start(scenario, &options).unwrap();
    let first = 1 + rng.below(120) as i64;
    run.run_to(Rational::from_millis(first)).unwrap();
    let here = run.save().unwrap();
    run.run_to(Rational::from_millis(first + rng.below(150) as i64))
        .unwrap();
    (0..rng.below(20)).for_each(|_| run.step().unwrap());
    run.restore(&here).unwrap();
    run.run_to("300 ms").unwrap();
    run.restore(&here).unwrap();
    run.run_to("300 ms").unwrap();
    digest(run.end().unwrap(), &format!("{seed} with rests"))
}
