//! Participants that violate the protocol: whatever they write into shared memory, the run ends, names them, and leaves nothing behind.

use escapement_tests::fixture::write_oscillator;
use escapement_tests::machine::processes_of;
use escapement_tests::program::{Folder, ProgramOutput, participant, run_orchestrator};

/// Checks that the run ends with code 1 and reports all of `words`.
fn assert_violation_reported(violation: &str, words: &[&str]) -> (Folder, ProgramOutput) {
    assert_violation_reported_with(violation, &[], words)
}

/// As [`assert_violation_reported`], with `more` on the command line.
fn assert_violation_reported_with(violation: &str, more: &[&str], words: &[&str]) -> (Folder, ProgramOutput) {
    let folder = Folder::new(violation);
    let scenario = write_oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let run = format!(
        "participants.damper.run={{ exe = '{}', args = ['{violation}'] }}",
        participant("violates").display()
    );
    let scenario = scenario.to_str().expect("paths of tests are text");
    let out = out.to_str().expect("paths of tests are text");
    let base = ["run", scenario, "--set", &run, "--out", out, "--start-within", "3 s"];
    let output = run_orchestrator(&[&base, more].concat());
    assert_eq!(output.code, Some(1), "{output:?}");
    for word in words {
        assert!(output.err.contains(word), "`{word}` is missing: {output:?}");
    }
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
    (folder, output)
}

#[test]
fn early_finish_event_is_refused_and_its_sender_named() {
    let has = "has recorded 100 samples of `damper.push` where the plan has 1000";
    let (folder, _) = assert_violation_reported("finishes", &["`damper`: reports that it has finished", has]);
    let summary = std::fs::read_to_string(folder.path().join("run/summary.json")).unwrap();
    assert!(
        summary.contains("\"failed\"") && !summary.contains("\"complete\""),
        "{summary}"
    );
}

#[test]
fn false_pause_event_is_refused_before_a_checkpoint() {
    for (violation, words) in [
        (
            "pauses-early",
            "at t = 2 s before its activation 100; by the plan it rests there before activation 200",
        ),
        (
            "pauses-short",
            "at t = 2 s, and has recorded 100 samples of `damper.push` where the plan has 200",
        ),
        ("pauses-beyond", "at t = 3 s; it is granted no time after t = 2 s"),
    ] {
        let (folder, _) = assert_violation_reported_with(
            violation,
            &["--checkpoint-at", "2 s"],
            &["`damper`: reports that it rests", words],
        );
        assert!(!folder.path().join("run/checkpoints").exists(), "{violation}");
    }
}

#[test]
fn second_publisher_of_a_record_is_named_not_its_owner() {
    let (_, output) = assert_violation_reported(
        "opens-other-record",
        &[
            "`damper`: process",
            "opened the record of `plant`, which is not its own",
        ],
    );
    assert!(!output.err.contains("participant `plant`"), "{output:?}");
}

#[test]
fn consumer_finds_samples_without_a_wake_up() {
    let folder = Folder::new("wakes");
    let scenario = write_oscillator(&folder, "damper");
    let run = format!(
        "participants.damper.run={{ exe = '{}', args = ['wakes-none'] }}",
        participant("violates").display()
    );
    let out = folder.path().join("run");
    let (scenario, out) = (scenario.to_str().unwrap(), out.to_str().unwrap());
    let run = [
        "run",
        scenario,
        "--out",
        out,
        "--wait",
        "sleep",
        "--duration",
        "1200 ms",
        "--set",
        &run,
    ];
    let output = run_orchestrator(&run);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn sample_past_the_granted_time_is_refused() {
    assert_violation_reported_with(
        "past-the-horizon",
        &["--pause-at", "1 s"],
        &[
            "`damper`: recorded sample #100 of `damper.push`",
            "it is granted no time after t = 1 s",
        ],
    );
}

#[test]
fn repeated_events_do_not_count_as_progress() {
    assert_violation_reported_with(
        "repeats-itself",
        &["--patience", "3 s"],
        &["`damper`: nothing has moved for 3."],
    );
}

#[test]
fn participant_text_cannot_steer_the_terminal_or_fake_lines() {
    let steers = |text: &str| text.contains(|c: char| c.is_control() && c != '\n');
    for violation in ["steers-the-terminal", "steers-in-its-log", "steers-in-a-unit"] {
        let (folder, output) = assert_violation_reported(violation, &["`damper`", r"\u{1b}[2J"]);
        assert!(!steers(&output.err) && !steers(&output.out), "{output:?}");
        let fakes = |line: &str| line.starts_with("error: all") || line.trim_start().starts_with("error: all");
        assert!(!output.err.lines().any(fakes), "{output:?}");
        if violation == "steers-in-its-log" {
            // The log has what was written.
            let log = std::fs::read(folder.path().join("run/log/damper.stderr")).unwrap();
            assert!(log.starts_with(b"\x1b[2J\0last\nerror: all is well\n"), "{log:?}");
        }
    }
}

#[test]
fn subscriber_rejects_repeated_sample() {
    assert_violation_reported("link-repeats", &["`damper.push` sent sample #99 after sample #99"]);
}

#[test]
fn subscriber_rejects_sample_out_of_order() {
    assert_violation_reported("link-back", &["`damper.push` sent sample #50 after sample #99"]);
}

#[test]
fn second_connection_to_the_recorder_is_named_at_once() {
    assert_violation_reported("record-twice", &["`damper`", "opened a second way to the recorder"]);
}

#[test]
fn subscriber_rejects_skipped_sample() {
    assert_violation_reported("link-skips", &["`damper.push` sent sample #101 where #100 is due"]);
}

#[test]
fn subscriber_rejects_false_stamp() {
    assert_violation_reported(
        "link-stamp",
        &["`damper.push` sent sample #100 stamped", "its stamp must be 1 s"],
    );
}

#[test]
fn subscriber_rejects_nan() {
    assert_violation_reported("link-nan", &["`damper.push` sent sample #100 with force = NaN"]);
}

#[test]
fn recorder_rejects_false_record_and_names_its_sender() {
    let of = "`damper`";
    assert_violation_reported("record-repeats", &[of, "stamped 1 s; its stamp must be 0.99 s"]);
    assert_violation_reported("record-back", &[of, "damper.push", "50", "100"]);
    assert_violation_reported("record-skips", &[of, "damper.push", "101", "100"]);
    assert_violation_reported("record-stamp", &[of, "sample #100 stamped", "its stamp must be 1 s"]);
    assert_violation_reported("record-size", &[of, "damper.push", "9", "16"]);
    assert_violation_reported("record-stream", &[of, "which is not its own"]);
    assert_violation_reported("record-unknown", &[of, "stream 77, which is not its own"]);
    assert_violation_reported("record-last", &[of, "18446744073709551615"]);
}

#[test]
fn invalid_answer_is_refused_and_its_sender_named() {
    let of = "`damper`";
    assert_violation_reported("garbage", &[of, "a reply cannot be decoded"]);
    assert_violation_reported("count", &[of, "a reply cannot be decoded"]);
    assert_violation_reported("nothing", &[of, "a reply cannot be decoded"]);
    assert_violation_reported("answer", &[of, "answered its part of the plan with"]);
}

#[test]
fn other_protocol_version_is_refused() {
    assert_violation_reported("version", &["`damper`", "`offender` speaks version"]);
}

#[test]
fn invalid_ports_are_refused() {
    assert_violation_reported("gap", &["`damper`", "describes invalid ports"]);
}

#[test]
fn participant_that_never_answers_is_named() {
    assert_violation_reported("silence", &["`damper`", "did not answer within 3 s"]);
}
