//! Whatever ends the writer, the tape is readable and a prefix of the undisturbed one.

mod common;

use std::fs::{self, OpenOptions};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use common::{TempFolder, payload, pose, scalar, spec, stamp};
use proptest::prelude::*;
use tape::{AppendError, Reader, Records, Source, StreamSpec, Writer};

/// Set in the child process that is killed: the folder to record to.
const KILLED_WRITER: &str = "RECORDER_TEST_VICTIM";

fn streams() -> Vec<StreamSpec> {
    vec![
        spec("plant", "truth", pose(), "0 s", "1 ms"),
        spec("controller", "command", scalar(), "0 s", "10 ms"),
    ]
}

fn append(writer: &mut Writer, stream: usize, index: u64) -> Result<(), AppendError> {
    let spec = &streams()[stream];
    writer.append(stream, index, stamp(spec, index), &payload(spec, index))
}

/// Every record that the reader gives is the one that was written.
fn assert_prefix(reader: &Reader) {
    for spec in &streams() {
        let stream = reader.stream(&spec.name()).unwrap();
        let mut records = Records::new(reader, stream);
        let mut index = 0;
        while let Some(record) = records.next().unwrap() {
            assert_eq!((record.index, record.stamp_s), (index, stamp(spec, index)));
            assert_eq!(record.payload, payload(spec, index));
            index += 1;
        }
        assert_eq!(index, reader.count(stream));
    }
}

/// Not a test by itself: the program that the next test kills.
#[test]
fn killed_writer_process() {
    let Some(dir) = std::env::var_os(KILLED_WRITER) else {
        return;
    };
    let mut writer = Writer::create(dir.as_ref(), streams()).unwrap();
    for k in 0.. {
        append(&mut writer, 0, k).unwrap();
        if k % 10 == 0 {
            append(&mut writer, 1, k / 10).unwrap();
        }
        if k == 5000 {
            writer.flush().unwrap();
            println!("flushed");
        }
    }
}

#[test]
fn killed_writer_keeps_flushed_samples() {
    let scratch = TempFolder::new("kill");
    let dir = scratch.join("tape");
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "killed_writer_process", "--nocapture"])
        .env(KILLED_WRITER, &dir)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().ends_with("flushed")));
    child.kill().unwrap();
    child.wait().unwrap();
    let reader = Reader::open(&dir).unwrap();
    assert!(reader.count(reader.stream("plant.truth").unwrap()) >= 5001);
    assert!(reader.count(reader.stream("controller.command").unwrap()) >= 501);
    assert_eq!(reader.sealed_digest(), None);
    assert_prefix(&reader);
}

/// A file system of 256 KiB. Needs the right to mount; where that is missing, the unit test with `/dev/full` has to do.
#[test]
fn full_disk_leaves_readable_tape() {
    let scratch = TempFolder::new("tmpfs");
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"])
        .arg(&scratch.0)
        .stderr(Stdio::null())
        .status();
    if !mounted.is_ok_and(|status| status.success()) {
        eprintln!("skipped: this user may not mount a tmpfs");
        return;
    }
    let outcome = std::panic::catch_unwind(|| {
        let mut writer = Writer::create(&scratch.join("tape"), streams()).unwrap();
        let error = (0..).find_map(|k| append(&mut writer, 0, k).err()).unwrap();
        let text = error.to_string();
        assert!(matches!(error, AppendError::DiskFull { .. }), "{text}");
        assert!(text.contains("plant.truth.bin"), "{text}");
        let error = writer.finish().unwrap_err();
        assert!(matches!(error, AppendError::DiskFull { .. }), "{error}");
        let reader = Reader::open(&scratch.0).unwrap();
        assert!(reader.count(reader.stream("plant.truth").unwrap()) > 3000);
        assert_eq!(reader.sealed_digest(), None);
        assert_prefix(&reader);
    });
    let unmounted = Command::new("umount").arg(&scratch.0).status().unwrap();
    assert!(unmounted.success());
    if let Err(panic) = outcome {
        std::panic::resume_unwind(panic);
    }
}

fn recorded(scratch: &TempFolder, samples: u64) -> std::path::PathBuf {
    let dir = scratch.join("tape");
    let mut writer = Writer::create(&dir, streams()).unwrap();
    for k in 0..samples {
        append(&mut writer, 0, k).unwrap();
        append(&mut writer, 1, k).unwrap();
    }
    writer.finish().unwrap();
    dir
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Truncated anywhere, a stream file is a prefix, and the incomplete record is reported.
    #[test]
    fn reader_omits_and_reports_incomplete_record(keep in 0_u64..56 * 40) {
        let scratch = TempFolder::new("torn");
        let dir = recorded(&scratch, 40);
        let file = OpenOptions::new().write(true).open(dir.join("plant.truth.bin")).unwrap();
        file.set_len(keep).unwrap();
        fs::remove_file(dir.join("seal.json")).unwrap();
        let reader = Reader::open(&dir).unwrap();
        prop_assert_eq!(reader.count(reader.stream("plant.truth").unwrap()), keep / 56);
        let torn = reader.incomplete_records();
        if keep % 56 == 0 {
            prop_assert!(torn.is_empty());
        } else {
            prop_assert_eq!((&*torn[0].stream, torn[0].complete, torn[0].bytes), ("plant.truth", keep / 56, keep % 56));
        }
        assert_prefix(&reader);
    }

    /// One byte changed anywhere: an error or another digest, never a panic, and the seal does not fit any more.
    #[test]
    fn reader_never_panics_on_damaged_folder(which in 0_usize..4, at in any::<prop::sample::Index>(), flip in 1_u8..) {
        let scratch = TempFolder::new("damage");
        let dir = recorded(&scratch, 40);
        let path = dir.join(["index.json", "seal.json", "plant.truth.bin", "controller.command.bin"][which]);
        let mut bytes = fs::read(&path).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        fs::write(&path, &bytes).unwrap();
        let verified = Reader::open(&dir).and_then(|reader| {
            let _ = reader.digest()?;
            for stream in 0..reader.streams().len() {
                let mut records = Records::new(&reader, stream);
                while records.next()?.is_some() {}
            }
            reader.verify().map(|()| reader)
        });
        // An index that still opens and verifies has the same meaning in another spelling: a blank for a line feed, `10.ms` for `10 ms`.
        if let Ok(reader) = verified {
            prop_assert!(which < 2, "byte {at} of {path:?}");
            for spec in &streams() {
                prop_assert!(reader.streams().contains(spec), "byte {at} of {path:?}");
            }
        }
    }

    /// Any text at all in place of the index.
    #[test]
    fn reader_never_panics_on_foreign_index(text in "\\PC{0,200}", prefix in any::<bool>()) {
        let scratch = TempFolder::new("foreign");
        let dir = recorded(&scratch, 1);
        let text = if prefix {
            format!("{{\"format\":\"escapement-tape\",\"version\":1,\"streams\":[{text}]}}")
        } else {
            text
        };
        fs::write(dir.join("index.json"), &text).unwrap();
        let outcome = Reader::open(&dir);
        prop_assert!(outcome.is_err() || text.ends_with("[]}"), "{outcome:?}");
    }
}

#[test]
fn reader_rejects_invalid_index_naming_file() {
    let scratch = TempFolder::new("hostile");
    let dir = recorded(&scratch, 3);
    let good = fs::read_to_string(dir.join("index.json")).unwrap();
    let check = |from: &str, to: &str, part: &str| {
        let bad = good.replacen(from, to, 1);
        assert_ne!(bad, good, "{from}");
        fs::write(dir.join("index.json"), bad).unwrap();
        let text = Reader::open(&dir).unwrap_err().to_string();
        assert!(text.contains("index.json") && text.contains(part), "{text}");
    };
    check("escapement-tape", "another-tape", "another-tape");
    check("\"version\": 1", "\"version\": 2", "version 2");
    check("\"record_bytes\": 16", "\"record_bytes\": 17", "contradict");
    check("\"file\": \"controller", "\"file\": \"/etc/controller", "contradict");
    check("\"period\": \"10 ms\"", "\"period\": \"0 s\"", "positive");
    check("\"period\": \"10 ms\"", "\"period\": \"ten\"", "is not a time");
    check("\"size\": 48", "\"size\": 4294967295", "contradict");
    check(
        "\"first_index\": 0",
        "\"first_index\": 18446744073709551615",
        "beyond 2^62",
    );
    check("\"offset\": 24", "\"offset\": 4294967288", "field `count`");
    fs::write(dir.join("index.json"), "[".repeat(100_000)).unwrap();
    assert!(Reader::open(&dir).is_err());
    fs::remove_file(dir.join("index.json")).unwrap();
    let text = Reader::open(&dir).unwrap_err().to_string();
    assert!(text.contains("holds no tape"), "{text}");
}
