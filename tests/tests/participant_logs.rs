//! Logs of participants, and the call of `terminate`: the same lines from every language and in every way of running.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use engine::Catalogue;
use engine::run::{Ending, Options, Record, Run};
use engine::scenario::Scenario;
use escapement_tests::compiler::{NativeBuild, exe_override, library_override};
use escapement_tests::diary::Diary;
use escapement_tests::participants::in_process_options;
use escapement_tests::program::{Folder, participant, run_orchestrator, text};

/// Two diaries, of 10 ms and of 20 ms, for 50 ms.
const SCENARIO: &str = "duration = \"50 ms\"\n[participants.first]\nrun = { builtin = \"diary\" }\nperiod = \"10 ms\"\n\
                        [participants.second]\nrun = { builtin = \"diary\" }\nperiod = \"20 ms\"\n";

/// The log of the first diary when `end` is the last line.
fn expected_log(end: &str) -> String {
    format!("first at t = 0 s: begins\nfirst at t = 0.02 s: is at page 3\n{end}")
}

/// The diaries that are not builtins: a program in each language, and a plug-in where the language has one; `participants.NAME.run` of
/// each.
fn external_diaries() -> &'static [(String, bool)] {
    static ALL: OnceLock<Vec<(String, bool)>> = OnceLock::new();
    ALL.get_or_init(|| {
        let native_build = NativeBuild::new("diaries");
        let mut all = vec![(exe_override("NAME", &participant("diary")), false)];
        for (source, name) in [("tests/plugins/diary.c", "c"), ("tests/plugins/diary.cpp", "cpp")] {
            all.push((
                exe_override("NAME", &native_build.program(source, &format!("{name}/diary"), &[])),
                false,
            ));
            let plugin = native_build.plugin(source, &format!("{name}/libdiary.so"), &["-DESCAPEMENT_NO_MAIN"]);
            all.push((library_override("NAME", &plugin, None), true));
        }
        all
    })
}

/// Runs the scenario with `run` in both slots and returns the log of the first one, in processes and, where possible, in one.
fn run_and_read_log(folder: &Folder, run: &str, inside: bool, more: &[&str], code: i32) -> String {
    let scenario = folder.write("diaries.toml", SCENARIO);
    let out = folder.path().join("out");
    let (first, second) = (run.replace("NAME", "first"), run.replace("NAME", "second"));
    let mut all = vec![
        "run",
        text(&scenario),
        "--force",
        "--quiet",
        "--out",
        text(&out),
        "--set",
        &first,
        "--set",
        &second,
    ];
    all.extend(inside.then_some("--in-process"));
    all.extend(more);
    let output = run_orchestrator(&all);
    assert_eq!(output.code, Some(code), "{run} {more:?}: {output:?}");
    log(&out, "first")
}

fn log(out: &Path, name: &str) -> String {
    let whole = std::fs::read_to_string(out.join("log").join(format!("{name}.stderr"))).unwrap_or_default();
    // After these lines, the host of a process reports why it failed.
    whole
        .lines()
        .filter(|line| line.starts_with(&format!("{} at t = ", name.trim_end_matches(".1"))))
        .map(|line| line.to_owned() + "\n")
        .collect()
}

#[test]
fn logs_are_equal_in_every_language_and_way_of_running() {
    let folder = Folder::new("diaries");
    for (run, can_be_inside) in external_diaries() {
        for inside in [false, true].into_iter().filter(|inside| !inside || *can_be_inside) {
            let end = "first at t = 0.05 s: ends, finished, at page 5\n";
            assert_eq!(
                run_and_read_log(&folder, run, inside, &[], 0),
                expected_log(end),
                "{run}, inside: {inside}"
            );
            // Another participant fails earlier.
            let fails = ["--set", "participants.second.parameters.fails-at=1"];
            let stopped = run_and_read_log(&folder, run, inside, &fails, 1);
            // In a separate process the first one may not have started by then; it is then not called.
            let count = |word: &str| stopped.matches(word).count();
            assert_eq!(count("begins"), count("ends, "), "{run}, inside: {inside}: {stopped}");
            assert!(
                count("ends, ") <= 1 && (!inside || count("ends, stopped") == 1),
                "{run}: {stopped}"
            );
            let own = log(&folder.path().join("out"), "second");
            assert_eq!(
                own, "second at t = 0 s: begins\nsecond at t = 0.02 s: ends, stopped, at page 2\n",
                "{run}, inside: {inside}"
            );
        }
    }
}

#[test]
fn replaced_participant_terminates_with_that_reason() {
    let folder = Folder::new("replaced");
    for (run, can_be_inside) in external_diaries() {
        let (_, table) = run.split_once('=').expect("a run");
        let fault = format!("\n[[faults]]\nat = \"30 ms\"\nsubstitute = \"first\"\nrun = {table}\nstate = \"keep\"\n");
        let scenario = folder.write("replaced.toml", &(SCENARIO.to_owned() + &fault));
        for inside in [false, true].into_iter().filter(|inside| !inside || *can_be_inside) {
            let out = folder.path().join("out");
            let sets = ["first", "second"].map(|name| run.replace("NAME", name));
            let mut all = vec!["run", text(&scenario), "--force", "--quiet", "--out", text(&out)];
            sets.iter().for_each(|set| all.extend(["--set", set]));
            all.extend(inside.then_some("--in-process"));
            let output = run_orchestrator(&all);
            assert_eq!(output.code, Some(0), "{run}: {output:?}");
            let replaced = expected_log("first at t = 0.03 s: ends, replaced, at page 3\n");
            let newcomer = "first at t = 0.03 s: begins\nfirst at t = 0.05 s: ends, finished, at page 5\n";
            // In separate processes, the replacement has its own log.
            let logs = if inside {
                vec![log(&out, "first")]
            } else {
                vec![log(&out, "first"), log(&out, "first.1")]
            };
            assert_eq!(logs.concat(), replaced + newcomer, "{run}, inside: {inside}");
            let other = log(&out, "second");
            assert!(
                other.ends_with("second at t = 0.06 s: ends, finished, at page 3\n"),
                "{run}: {other}"
            );
            assert_eq!(other.matches("begins").count(), 1, "{run}: {other}");
        }
    }
}

fn scenario(more: &str) -> Scenario {
    let catalogue = Catalogue::new("tests").participant("diary", Diary::factory);
    let read = Scenario::read_text(
        &Arc::new(catalogue),
        Path::new("code.toml"),
        &(SCENARIO.to_owned() + more),
    );
    read.unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn outcome_without_a_folder_contains_the_logs() {
    for record in [Record::Memory, Record::Digest, Record::Nothing] {
        let outcome = engine::run::run(&scenario(""), &in_process_options(record)).unwrap();
        assert_eq!(
            outcome.logs["first"],
            expected_log("first at t = 0.05 s: ends, finished, at page 5\n")
        );
        assert!(outcome.logs["second"].ends_with("second at t = 0.06 s: ends, finished, at page 3\n"));
    }
}

#[test]
fn restored_run_terminates_no_participant_dropped_run_all() {
    let mut run = Run::start(&scenario(""), &in_process_options(Record::Memory)).unwrap();
    run.run_to("30 ms").unwrap();
    let here = run.save().unwrap();
    run.run_to("50 ms").unwrap();
    run.restore(&here).unwrap();
    let outcome = run.end().unwrap();
    let end = "first at t = 0.03 s: ends, stopped, at page 3\n";
    assert_eq!(outcome.logs["first"], expected_log(end), "back from the end");
    let folder = Folder::new("dropped");
    let out = folder.path().join("out");
    let options = Options {
        out: Some(out.clone()),
        ..in_process_options(Record::Folder)
    };
    let mut run = Run::start(&scenario(""), &options).unwrap();
    run.run_to("30 ms").unwrap();
    drop(run);
    assert_eq!(log(&out, "first"), expected_log(end), "dropped");
}

#[test]
fn panicked_participant_is_not_terminated_but_others_are() {
    let mut run = Run::start(
        &scenario("parameters = { panics-at = 1 }\n"),
        &in_process_options(Record::Memory),
    )
    .unwrap();
    run.run_to("50 ms").unwrap_err();
    let outcome = run.end().unwrap();
    let Ending::Failed { participant, reason } = &outcome.ending else {
        panic!("{:?}", outcome.ending)
    };
    assert!(
        participant == "second" && reason.contains("the diary burns"),
        "{reason}"
    );
    assert_eq!(outcome.logs["second"], "second at t = 0 s: begins\n");
    assert!(
        outcome.logs["first"].ends_with("ends, stopped, at page 2\n"),
        "{}",
        outcome.logs["first"]
    );
}
