//! Runs driven from code: the same tape however they are executed and however often they are paused; inputs that are set; branches that
//! are tried and discarded.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use engine::Catalogue;
use engine::run::{Checkpoint, Ending, Options, Outcome, Record, Run, RunFailure};
use engine::scenario::{Program, Scenario};
use escapement_tests::participants::{Damper, Motion, Oscillator, Push, in_process_options};
use escapement_tests::program::{Folder, participant};
use lockstep::participant::Factory;
use lockstep::time::Rational;

/// An oscillator with `damper`, or with an unconnected push.
fn scenario(processes: bool, damped: bool, more: &str) -> Scenario {
    let catalogue = Catalogue::new("tests")
        .participant("oscillator", Oscillator::factory)
        .participant("damper", Damper::factory);
    let run = |name: &str| match processes {
        true => format!("{{ exe = \"{}\" }}", participant(name).display()),
        false => format!("{{ builtin = \"{name}\" }}"),
    };
    let mut text = format!(
        "duration = \"2 s\"\n{}[participants.plant]\nrun = {}\nperiod = \"1 ms\"\n",
        if damped { "" } else { "inputs = [\"plant.push\"]\n" },
        run("oscillator")
    );
    if damped {
        text += &format!(
            "[participants.damper]\nrun = {}\nperiod = \"10 ms\"\n[connections.motion]\nfrom = \"plant.motion\"\nto = \"damper.motion\"\n\
             [connections.push]\nfrom = \"damper.push\"\nto = \"plant.push\"\n",
            run("damper")
        );
    }
    let read = Scenario::read_text(&Arc::new(catalogue), Path::new("code.toml"), &(text + more));
    read.unwrap_or_else(|error| panic!("{error}"))
}

fn into_folder(folder: &Folder, name: &str, in_process: bool) -> Options {
    Options {
        in_process,
        out: Some(folder.path().join(name)),
        ..Options::default()
    }
}

/// The digest and the last position of a run that reached its end.
fn finish_run(run: Run) -> (String, Outcome) {
    let outcome = run.end().expect("a summary");
    assert_eq!(outcome.ending, Ending::Complete);
    (outcome.digest.expect("a digest").to_string(), outcome)
}

fn position(run: &Run) -> f64 {
    run.newest("plant.motion").unwrap().get::<Motion>().unwrap().position
}

/// All kinds of record, in one process and in processes.
fn record_options(folder: &Folder, name: &str) -> Vec<(bool, Options)> {
    vec![
        (false, in_process_options(Record::Memory)),
        (false, into_folder(folder, &format!("{name}-inside"), true)),
        (true, into_folder(folder, &format!("{name}-processes"), false)),
    ]
}

#[test]
fn pauses_and_steps_do_not_change_the_tape() {
    let _alone = lock_processes();
    let folder = Folder::new("rests");
    let whole = engine::run::run(&scenario(false, true, ""), &in_process_options(Record::Digest)).unwrap();
    let whole = whole.digest.expect("a digest").to_string();
    for (processes, options) in record_options(&folder, "rests") {
        let mut run = Run::start(&scenario(processes, true, ""), &options).unwrap();
        assert_eq!((run.now(), position(&run)), (Rational::ZERO, 1.0));
        for _ in 0..3 {
            run.step().unwrap();
        }
        assert_eq!(run.now(), "3 ms".parse().unwrap());
        run.run_to("1/3 s").unwrap();
        let motion = run.newest("plant.motion").unwrap();
        assert_eq!((motion.index(), motion.stamp_s()), (334, 0.334));
        assert_eq!(
            motion.field("position").unwrap(),
            [motion.get::<Motion>().unwrap().position]
        );
        run.run_to("2 s").unwrap();
        assert!(run.is_over());
        assert_eq!(finish_run(run).0, whole, "processes: {processes}");
    }
    assert_eq!(children(), 0);
}

#[test]
fn loop_closed_from_code_is_reproducible_in_every_way() {
    let _alone = lock_processes();
    let folder = Folder::new("closed");
    let mut tapes = Vec::new();
    for (processes, options) in record_options(&folder, "closed") {
        let mut run = Run::start(&scenario(processes, false, ""), &options).unwrap();
        for k in 1..=8 {
            let motion: Motion = run.newest("plant.motion").unwrap().get().unwrap();
            let force = Damper::force(&motion);
            if k % 2 == 0 {
                run.set("plant.push", &Push { force, count: k }).unwrap();
            } else {
                let fields = [("force", &[force][..]), ("count", &[k as f64])];
                run.set_fields("plant.push", &fields).unwrap();
            }
            run.run_to(Rational::from_millis(200 * k as i64)).unwrap();
        }
        run.run_to("2 s").unwrap();
        tapes.push(finish_run(run).0);
    }
    assert_eq!(tapes[0], tapes[1]);
    assert_eq!(tapes[1], tapes[2], "in processes");
    let idle = engine::run::run(&scenario(false, false, ""), &in_process_options(Record::Digest)).unwrap();
    assert_ne!(
        idle.digest.expect("a digest").to_string(),
        tapes[0],
        "the input is seen"
    );
    // The events of the tape contain the inputs that were set, so that a replay sets them again.
    let root: PathBuf = folder.path().join("closed-inside");
    let events = std::fs::read_to_string(root.join("tape/events.jsonl")).unwrap();
    assert_eq!(events.matches("\"input\"").count(), 8, "{events}");
    let catalogue = Arc::new(Catalogue::new("tests").participant("oscillator", Oscillator::factory));
    let replay = engine::replay::Replay::plan(&engine::replay::Request {
        catalogue: &catalogue,
        folder: &root,
        participant: "plant",
        overrides: &[],
        program: None,
        run: None,
        to: None,
        unverified: false,
    });
    let found = replay.unwrap().run(&into_folder(&folder, "replayed", true)).unwrap();
    let comparison = found.comparison.expect("samples are compared");
    assert!(comparison.identical, "{comparison:?}");
}

#[test]
fn abandoned_branch_is_not_on_the_tape() {
    let _alone = lock_processes();
    let folder = Folder::new("futures");
    let push = |force: f64| Push { force, count: 0 };
    let mut tapes = Vec::new();
    for (processes, options) in record_options(&folder, "futures") {
        let mut run = Run::start(&scenario(processes, false, ""), &options).unwrap();
        run.set("plant.push", &push(0.25)).unwrap();
        run.run_to("0.5 s").unwrap();
        let (here, before) = (run.save().unwrap(), position(&run));
        assert_eq!(here.time(), "0.5 s".parse().unwrap());
        // To the end, and to an instant in between.
        run.set("plant.push", &push(3.0)).unwrap();
        run.run_to("2 s").unwrap();
        let strong = position(&run);
        run.restore(&here).unwrap();
        assert_eq!((run.now(), position(&run)), (here.time(), before));
        let later: Checkpoint = {
            run.set("plant.push", &push(-3.0)).unwrap();
            run.run_to("0.7 s").unwrap();
            run.save().unwrap()
        };
        run.restore(&here).unwrap();
        let left = run.restore(&later).unwrap_err();
        assert!(left.to_string().contains("left behind"), "{left}");
        run.run_to("2 s").unwrap();
        assert_ne!(position(&run), strong);
        tapes.push(finish_run(run).0);
    }
    let mut plain = Run::start(&scenario(false, false, ""), &in_process_options(Record::Memory)).unwrap();
    plain.set("plant.push", &push(0.25)).unwrap();
    plain.run_to("2 s").unwrap();
    let plain = finish_run(plain).0;
    assert_eq!(tapes, [plain.clone(), plain.clone(), plain]);
    let events = std::fs::read_to_string(folder.path().join("futures-processes/tape/events.jsonl")).unwrap();
    assert_eq!(events.lines().count(), 1, "{events}");
}

#[test]
fn simultaneous_runs_are_isolated_and_clean_up_on_drop() {
    let _alone = lock_processes();
    let folder = Folder::new("two");
    let mut one = Run::start(&scenario(true, true, ""), &into_folder(&folder, "one", false)).unwrap();
    let own = address();
    let mut two = Run::start(&scenario(true, true, ""), &into_folder(&folder, "two", false)).unwrap();
    one.run_to("1 s").unwrap();
    two.run_to("0.3 s").unwrap();
    assert_eq!((children(), shared_memory(&own).is_empty()), (4, false));
    drop(one);
    assert_eq!(shared_memory(&own), Vec::<String>::new());
    assert_eq!(children(), 2);
    two.run_to("2 s").unwrap();
    let (digest, outcome) = finish_run(two);
    let whole = engine::run::run(&scenario(false, true, ""), &in_process_options(Record::Digest)).unwrap();
    assert_eq!(Some(digest), whole.digest.map(|digest| digest.to_string()));
    assert!(outcome.folder.expect("a folder").join("summary.json").is_file());
    assert_eq!(children(), 0);
}

/// Only one test of this file at a time has processes.
fn lock_processes() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is in shared memory of the run with this address.
fn shared_memory(address: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.contains(address)).collect()
}

/// The common part of the names in shared memory of the run of a child process, from the environment of the child.
fn address() -> String {
    let environment = statuses().find_map(|(process, _)| std::fs::read_to_string(process.join("environ")).ok());
    let environment = environment.expect("a child process");
    let run = environment
        .split('\0')
        .find_map(|variable| variable.strip_prefix("ESCAPEMENT_RUN="));
    let prefix = run.and_then(|run| run.split('@').next()).expect("a run");
    prefix.trim_start_matches("esc").trim_matches('_').to_owned()
}

/// The child processes that still exist: folder and status in /proc.
fn statuses() -> impl Iterator<Item = (PathBuf, String)> {
    let parent = format!("PPid:\t{}\n", std::process::id());
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let all =
        entries.filter_map(|entry| Some((entry.path(), std::fs::read_to_string(entry.path().join("status")).ok()?)));
    all.filter(move |(_, status)| status.contains(&parent))
}

/// The number of child processes that still exist.
fn children() -> usize {
    statuses().count()
}

#[test]
fn invalid_request_from_code_is_refused_by_name() {
    let refusal = |failure: RunFailure| failure.to_string();
    let damped = scenario(false, true, "");
    let mut run = Run::start(&damped, &in_process_options(Record::Memory)).unwrap();
    let push = Push { force: 1.0, count: 1 };
    let cases = [
        (run.set("plant.push", &push), "damper.push"),
        (run.set("plant.pull", &push), "`push`"),
        (run.set("pump.push", &push), "no participant `pump`"),
        (run.newest("plant.push").map(drop), "plant.motion"),
        (run.newest("damper.push").map(drop), "no sample yet"),
        (run.newest("plant.motion").unwrap().get::<Push>().map(drop), "Push"),
        (
            run.newest("plant.motion").unwrap().field("force").map(drop),
            "`velocity`",
        ),
        (run.run_to("3 s"), "the end of the run at 2 s"),
        (run.run_to("soon"), "not a time"),
    ];
    for (result, part) in cases {
        let message = refusal(result.unwrap_err());
        assert!(message.contains(part), "{part}: {message}");
    }
    run.run_to("1 s").unwrap();
    let message = refusal(run.run_to("0.5 s").unwrap_err());
    assert!(message.contains("has passed"), "{message}");
    let outcome = run.end().unwrap();
    assert!(matches!(outcome.ending, Ending::Stopped { .. }) && outcome.simulated_s >= 1.0);

    let open = scenario(false, false, "");
    let mut run = Run::start(&open, &in_process_options(Record::Digest)).unwrap();
    let message = refusal(run.set_fields("plant.push", &[("force", &[f64::NAN])]).unwrap_err());
    assert!(message.contains("finite"), "{message}");
    let message = refusal(run.save().unwrap_err());
    assert!(message.contains("Record::Memory"), "{message}");
    let options = Options {
        record: Record::Digest,
        ..Options::default()
    };
    let message = refusal(Run::start(&open, &options).err().expect("refused"));
    assert!(message.contains("Record::Folder"), "{message}");
}

#[test]
fn participant_failure_ends_the_run_and_is_in_the_handle() {
    let _alone = lock_processes();
    let folder = Folder::new("fails");
    let text = |run: &str| {
        format!(
            "duration = \"10 s\"\n[participants.plant]\nrun = {{ builtin = \"oscillator\" }}\nperiod = \"1 ms\"\n\
             [participants.damper]\nrun = {{ exe = \"{run}\" }}\nperiod = \"10 ms\"\n[connections.motion]\nfrom = \"plant.motion\"\n\
             to = \"damper.motion\"\n[connections.push]\nfrom = \"damper.push\"\nto = \"plant.push\"\n"
        )
        .replace("{ builtin = \"oscillator\" }", &format!("{{ exe = \"{}\" }}", participant("oscillator").display()))
    };
    let catalogue = Arc::new(Catalogue::new("tests"));
    let text = text(&participant("crash_at").display().to_string());
    let scenario = Scenario::read_text(&catalogue, Path::new("fails.toml"), &text).unwrap();
    let mut run = Run::start(&scenario, &into_folder(&folder, "run", false)).unwrap();
    let output = run.run_to("10 s").unwrap_err().to_string();
    assert!(
        output.contains("the run is over") && output.contains("damper"),
        "{output}"
    );
    assert!(run.is_over());
    let outcome = run.end().unwrap();
    assert!(matches!(&outcome.ending, Ending::Failed { participant, .. } if participant == "damper"));
    assert_eq!(children(), 0);
}

#[test]
fn programs_that_a_catalogue_knows_run_in_this_process() {
    let _alone = lock_processes();
    let known = participant("oscillator");
    let text = format!(
        "duration = \"1 s\"\ninputs = [\"plant.push\"]\n[participants.plant]\nrun = {{ exe = \"{}\" }}\nperiod = \"1 ms\"\n",
        known.display()
    );
    let read =
        |catalogue: Catalogue| Scenario::read_text(&Arc::new(catalogue), Path::new("within.toml"), &text).unwrap();
    let file = known.clone();
    let within =
        move |program: &Program| (program.file() == Some(&*file)).then(|| -> Factory { Arc::new(Oscillator::factory) });
    let here = read(Catalogue::new("tests").within(within));
    let outcome = engine::run::run(&here, &in_process_options(Record::Digest)).unwrap();
    // Without `within` the program stays a separate one, and also with it if every participant has a process.
    let refused = engine::run::run(&read(Catalogue::new("tests")), &in_process_options(Record::Digest))
        .err()
        .unwrap();
    assert!(
        refused
            .to_string()
            .contains("participant `plant` is a program of its own"),
        "{refused}"
    );
    let folder = Folder::new("within");
    let apart = engine::run::run(&here, &into_folder(&folder, "apart", false)).unwrap();
    assert_eq!(outcome.digest, apart.digest);
    assert!(outcome.placement.contains("one process") && !apart.placement.contains("one process"));
}
