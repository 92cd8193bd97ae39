//! Participants that break the protocol: whatever they write into shared memory, the run ends, names them, and leaves nothing.

use escapement_tests::machine::processes_of;
use escapement_tests::program::{Folder, orchestrate, participant};
use escapement_tests::world::oscillator;

/// The run ends with code 1 and says all of `words`.
fn caught(lie: &str, words: &[&str]) {
    let folder = Folder::new(lie);
    let scenario = oscillator(&folder, "damper");
    let out = folder.path().join("run");
    let run = format!(
        "participants.damper.run={{ exe = '{}', args = ['{lie}'] }}",
        participant("lies").display()
    );
    let scenario = scenario.to_str().expect("paths of tests are text");
    let out = out.to_str().expect("paths of tests are text");
    let said = orchestrate(&["run", scenario, "--set", &run, "--out", out]);
    assert_eq!(said.code, Some(1), "{said:?}");
    for word in words {
        assert!(said.err.contains(word), "`{word}` is missing: {said:?}");
    }
    assert_eq!(processes_of(folder.path()), Vec::<String>::new(), "processes are left");
}

#[test]
fn a_repeated_sample_is_refused_by_its_reader() {
    caught("link-repeats", &["`damper.push` sent sample #99 after sample #99"]);
}

#[test]
fn a_sample_out_of_order_is_refused_by_its_reader() {
    caught("link-back", &["`damper.push` sent sample #50 after sample #99"]);
}

#[test]
fn a_second_way_to_the_recorder_is_named_at_once() {
    caught("record-twice", &["`damper`", "opened a second way to the recorder"]);
}

#[test]
fn a_skipped_sample_is_refused_by_its_reader() {
    caught("link-skips", &["`damper.push` sent sample #101 where #100 is due"]);
}

#[test]
fn a_false_stamp_is_refused_by_its_reader() {
    caught(
        "link-stamp",
        &["`damper.push` sent sample #100 stamped", "its stamp must be 1 s"],
    );
}

#[test]
fn a_nan_is_refused_by_its_reader() {
    caught("link-nan", &["`damper.push` sent sample #100 with force = NaN"]);
}

#[test]
fn a_false_record_is_refused_and_its_author_named() {
    let of = "`damper`";
    caught("record-repeats", &[of, "stamped 1 s; its stamp must be 0.99 s"]);
    caught("record-back", &[of, "damper.push", "50", "100"]);
    caught("record-skips", &[of, "damper.push", "101", "100"]);
    caught("record-stamp", &[of, "sample #100 stamped", "its stamp must be 1 s"]);
    caught("record-size", &[of, "damper.push", "9", "16"]);
    caught("record-stream", &[of, "which is not its own"]);
    caught("record-nobody", &[of, "stream 77, which is not its own"]);
    caught("record-last", &[of, "18446744073709551615"]);
}

#[test]
fn an_answer_that_is_none_is_refused_and_its_author_named() {
    let of = "`damper`";
    caught("garbage", &[of, "a reply cannot be decoded"]);
    caught("count", &[of, "a reply cannot be decoded"]);
    caught("nothing", &[of, "a reply cannot be decoded"]);
    caught("answer", &[of, "answered its part of the plan with"]);
}

#[test]
fn another_version_of_the_protocol_is_refused() {
    caught("version", &["`damper`", "`liar` speaks version"]);
}

#[test]
fn ports_that_cannot_be_are_refused() {
    caught("gap", &["`damper`", "describes ports that cannot be"]);
}

#[test]
fn who_never_answers_is_named() {
    caught("silence", &["`damper`", "did not answer within 20 s"]);
}
