//! Participants that violate the protocol: whatever they write into shared memory, the run ends, names them, and leaves nothing behind.

use escapement_tests::machine::processes_of;
use escapement_tests::program::{Folder, Said, orchestrate, participant};
use escapement_tests::world::oscillator;

/// Checks that the run ends with code 1 and reports all of `words`.
fn caught(violation: &str, words: &[&str]) -> (Folder, Said) {
    caught_with(violation, &[], words)
}

/// As [`caught`], with `more` on the command line.
fn caught_with(violation: &str, more: &[&str], words: &[&str]) -> (Folder, Said) {
    let folder = Folder::new(violation);
    let scenario = oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let run = format!(
        "participants.damper.run={{ exe = '{}', args = ['{violation}'] }}",
        participant("violates").display()
    );
    let scenario = scenario.to_str().expect("paths of tests are text");
    let out = out.to_str().expect("paths of tests are text");
    let base = ["run", scenario, "--set", &run, "--out", out, "--start-within", "3 s"];
    let said = orchestrate(&[&base, more].concat());
    assert_eq!(said.code, Some(1), "{said:?}");
    for word in words {
        assert!(said.err.contains(word), "`{word}` is missing: {said:?}");
    }
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
    (folder, said)
}

#[test]
fn early_finish_event_is_refused_and_its_sender_named() {
    let has = "has recorded 100 samples of `damper.push` where the plan has 1000";
    let (folder, _) = caught("finishes", &["`damper`: reports that it has finished", has]);
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
            "rests-early",
            "at t = 2 s before its activation 100; by the plan it rests there before activation 200",
        ),
        (
            "rests-short",
            "at t = 2 s, and has recorded 100 samples of `damper.push` where the plan has 200",
        ),
        ("rests-beyond", "at t = 3 s; it is granted no time after t = 2 s"),
    ] {
        let (folder, _) = caught_with(
            violation,
            &["--checkpoint-at", "2 s"],
            &["`damper`: reports that it rests", words],
        );
        assert!(!folder.path().join("run/checkpoints").exists(), "{violation}");
    }
}

#[test]
fn second_publisher_of_a_record_is_named_not_its_owner() {
    let (_, said) = caught(
        "intrudes",
        &[
            "`damper`: process",
            "opened the record of `plant`, which is not its own",
        ],
    );
    assert!(!said.err.contains("participant `plant`"), "{said:?}");
}

#[test]
fn consumer_finds_samples_although_no_notifier_wakes_it() {
    let folder = Folder::new("wakes");
    let scenario = oscillator(&folder, "damper");
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
    let said = orchestrate(&run);
    assert_eq!(said.code, Some(0), "{said:?}");
}

#[test]
fn sample_past_the_granted_time_is_refused() {
    caught_with(
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
    caught_with(
        "repeats-itself",
        &["--patience", "3 s"],
        &["`damper`: nothing has moved for 3."],
    );
}

#[test]
fn participant_text_cannot_steer_the_terminal_or_fake_lines() {
    let steers = |text: &str| text.contains(|c: char| c.is_control() && c != '\n');
    for violation in ["steers-the-terminal", "steers-in-its-log", "steers-in-a-unit"] {
        let (folder, said) = caught(violation, &["`damper`", r"\u{1b}[2J"]);
        assert!(!steers(&said.err) && !steers(&said.out), "{said:?}");
        let fakes = |line: &str| line.starts_with("error: all") || line.trim_start().starts_with("error: all");
        assert!(!said.err.lines().any(fakes), "{said:?}");
        if violation == "steers-in-its-log" {
            // The log has what was written.
            let log = std::fs::read(folder.path().join("run/log/damper.stderr")).unwrap();
            assert!(log.starts_with(b"\x1b[2J\0last\nerror: all is well\n"), "{log:?}");
        }
    }
}

#[test]
fn subscriber_rejects_repeated_sample() {
    caught("link-repeats", &["`damper.push` sent sample #99 after sample #99"]);
}

#[test]
fn subscriber_rejects_sample_out_of_order() {
    caught("link-back", &["`damper.push` sent sample #50 after sample #99"]);
}

#[test]
fn second_connection_to_the_recorder_is_named_at_once() {
    caught("record-twice", &["`damper`", "opened a second way to the recorder"]);
}

#[test]
fn subscriber_rejects_skipped_sample() {
    caught("link-skips", &["`damper.push` sent sample #101 where #100 is due"]);
}

#[test]
fn subscriber_rejects_false_stamp() {
    caught(
        "link-stamp",
        &["`damper.push` sent sample #100 stamped", "its stamp must be 1 s"],
    );
}

#[test]
fn subscriber_rejects_nan() {
    caught("link-nan", &["`damper.push` sent sample #100 with force = NaN"]);
}

#[test]
fn recorder_rejects_false_record_and_names_its_sender() {
    let of = "`damper`";
    caught("record-repeats", &[of, "stamped 1 s; its stamp must be 0.99 s"]);
    caught("record-back", &[of, "damper.push", "50", "100"]);
    caught("record-skips", &[of, "damper.push", "101", "100"]);
    caught("record-stamp", &[of, "sample #100 stamped", "its stamp must be 1 s"]);
    caught("record-size", &[of, "damper.push", "9", "16"]);
    caught("record-stream", &[of, "which is not its own"]);
    caught("record-unknown", &[of, "stream 77, which is not its own"]);
    caught("record-last", &[of, "18446744073709551615"]);
}

#[test]
fn invalid_answer_is_refused_and_its_sender_named() {
    let of = "`damper`";
    caught("garbage", &[of, "a reply cannot be decoded"]);
    caught("count", &[of, "a reply cannot be decoded"]);
    caught("nothing", &[of, "a reply cannot be decoded"]);
    caught("answer", &[of, "answered its part of the plan with"]);
}

#[test]
fn other_protocol_version_is_refused() {
    caught("version", &["`damper`", "`offender` speaks version"]);
}

#[test]
fn invalid_ports_are_refused() {
    caught("gap", &["`damper`", "describes ports that cannot be"]);
}

#[test]
fn participant_that_never_answers_is_named() {
    caught("silence", &["`damper`", "did not answer within 3 s"]);
}
