//! Invariants after a run: its tape, its report of how it ended, and what it has left on the machine.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{CheckResult, ensure, ensure_equal};
use crate::machine;
use crate::program::run_orchestrator;

fn json(path: &Path) -> CheckResult<Value> {
    let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    serde_json::from_slice(&bytes).map_err(|error| format!("{}: {error}", path.display()))
}

/// The undisturbed run of a case.
pub(super) struct ReferenceRun {
    pub(super) folder: PathBuf,
    /// The streams, with the size of their files and of a record, in the order of the index.
    streams: Vec<(String, Vec<u8>, usize)>,
    digest: String,
}

/// The part of the undisturbed tape that a run has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TapeExtent {
    Nothing,
    Prefix,
    Whole,
}

impl ReferenceRun {
    /// Reads the tape of a complete run.
    pub(super) fn read(folder: PathBuf) -> CheckResult<ReferenceRun> {
        let tape = folder.join("tape");
        let index = json(&tape.join("index.json"))?;
        let streams = index["streams"].as_array().cloned().unwrap_or_default().into_iter();
        let streams: CheckResult<Vec<_>> = streams
            .map(|stream| {
                let file = stream["file"].as_str().unwrap_or_default().to_owned();
                let bytes = fs::read(tape.join(&file)).map_err(|error| format!("{file}: {error}"))?;
                let record = stream["record_bytes"].as_u64().unwrap_or(1) as usize;
                Ok((file, bytes, record))
            })
            .collect();
        let streams = streams?;
        ensure(streams.iter().any(|(_, bytes, _)| !bytes.is_empty()), || {
            "the undisturbed tape is empty".into()
        })?;
        let seal = json(&tape.join("seal.json"))?;
        Ok(ReferenceRun {
            folder,
            streams,
            digest: seal["digest"].as_str().unwrap_or_default().to_owned(),
        })
    }

    /// The stream with the most samples, which shows the progress of a run, and its full size.
    pub(super) fn longest(&self) -> (&str, u64) {
        let samples = |(_, bytes, record): &&(String, Vec<u8>, usize)| bytes.len() / record;
        let longest = self.streams.iter().max_by_key(samples);
        longest.map_or(("", 0), |(file, bytes, _)| (file, bytes.len() as u64))
    }

    /// The size of that stream up to a checkpoint at `t` seconds; slightly more, because a checkpoint may lie between two samples.
    pub(super) fn up_to(&self, t: f64) -> u64 {
        let (longest, _) = self.longest();
        let stream = self.streams.iter().find(|(file, _, _)| file == longest);
        stream.map_or(0, |(_, bytes, record)| {
            let stamps = bytes.chunks_exact(*record).map(|sample| {
                let stamp = sample.first_chunk().expect("a record begins with its stamp");
                f64::from_le_bytes(*stamp)
            });
            (stamps.take_while(|stamp| *stamp <= t + 0.01).count() * record) as u64
        })
    }

    /// Compares the tape in the run folder `run` with the undisturbed one. `torn`: its writer was killed, so that the last record of a
    /// stream may be incomplete.
    pub(super) fn part(&self, run: &Path, torn: bool) -> CheckResult<TapeExtent> {
        let tape = run.join("tape");
        if !tape.join("index.json").exists() {
            return Ok(TapeExtent::Nothing);
        }
        ensure_equal(
            "index.json of the tape",
            &json(&tape.join("index.json")).or_else(|error| if torn { Ok(Value::Null) } else { Err(error) })?,
            &json(&self.folder.join("tape/index.json"))?,
        )
        .or_else(|error| if torn { Ok(()) } else { Err(error) })?;
        let mut part = TapeExtent::Whole;
        for (file, whole, record) in &self.streams {
            let bytes = match fs::read(tape.join(file)) {
                Ok(bytes) => bytes,
                Err(_) if torn => Vec::new(),
                Err(error) => return Err(format!("{file}: {error}")),
            };
            ensure(whole.starts_with(&bytes), || {
                let same = whole.iter().zip(&bytes).take_while(|(a, b)| a == b).count();
                format!(
                    "{} is no prefix of the undisturbed tape: {} bytes of {}, different from sample {} on",
                    tape.join(file).display(),
                    bytes.len(),
                    whole.len(),
                    same / record
                )
            })?;
            ensure(torn || bytes.len() % record == 0, || {
                format!("{file} ends within a sample")
            })?;
            if bytes.len() < whole.len() {
                part = TapeExtent::Prefix;
            }
        }
        let events = fs::read_to_string(tape.join("events.jsonl")).unwrap_or_default();
        let lines: Vec<&str> = events.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            let last = torn && number + 1 == lines.len();
            ensure(last || serde_json::from_str::<Value>(line).is_ok(), || {
                format!("events.jsonl has a line that is no event: {line}")
            })?;
        }
        Ok(part)
    }

    /// Checks that the report in the run folder agrees with itself, the tape and the exit code; returns the participant that it blames.
    pub(super) fn check_report(
        &self,
        run: &Path,
        code: i32,
        complete: i32,
        part: TapeExtent,
    ) -> CheckResult<Option<String>> {
        let summary = json(&run.join("summary.json"))?;
        let ending = &summary["ending"];
        let status = ending["status"].as_str().unwrap_or_default();
        ensure_equal(
            "whether the run is complete",
            &(status == "complete"),
            &(code == complete),
        )?;
        let digest = summary["tape_digest"].as_str().unwrap_or_default();
        let seal = json(&run.join("tape/seal.json"))?;
        ensure_equal("the digest in summary.json", &Some(digest), &seal["digest"].as_str())?;
        for stream in seal["streams"].as_array().into_iter().flatten() {
            let file = format!("{}.bin", stream["stream"].as_str().unwrap_or_default());
            let own = self.streams.iter().find(|(name, _, _)| *name == file);
            let record = own.map_or(1, |(_, _, record)| *record as u64);
            let size = fs::metadata(run.join("tape").join(&file)).map_or(0, |about| about.len());
            ensure_equal(
                &format!("the sealed count of {file}"),
                &stream["count"].as_u64(),
                &Some(size / record),
            )?;
        }
        ensure_equal(
            "whether the digest is that of the undisturbed tape",
            &(digest == self.digest),
            &(part == TapeExtent::Whole),
        )?;
        Ok(match status {
            "failed" => Some(ending["participant"].as_str().unwrap_or_default().to_owned()),
            _ => None,
        })
    }
}

/// Whether this process has a private `/dev/shm` that contains only objects of its own runs.
const PRIVATE: &str = "ESCAPEMENT_LONG_PRIVATE";

/// Declares `/dev/shm` private.
pub(super) fn private_memory(command: &mut std::process::Command) {
    command.env(PRIVATE, "1");
}

fn left_in_memory() -> Vec<String> {
    if std::env::var_os(PRIVATE).is_none() {
        return machine::leftovers();
    }
    let entries = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    entries.map(|entry| entry.path().display().to_string()).collect()
}

/// Nothing is left in shared memory or `scratch`. After a sudden end of the orchestrator, `doctor --remove` removes what is there.
pub(super) fn ensure_nothing_left(scratch: &Path, sudden: bool) -> CheckResult<()> {
    let left = || {
        let entries = fs::read_dir(scratch).into_iter().flatten().flatten();
        let files = entries.map(|entry| entry.path().display().to_string());
        files.chain(left_in_memory()).collect::<Vec<_>>()
    };
    let started = Instant::now();
    loop {
        let found = left();
        // With other runs of this user on the machine, one of them may be seen just as it ends.
        let patient = sudden || std::env::var_os(PRIVATE).is_none();
        // A folder without a lock counts as dead when it is ten seconds old.
        if found.is_empty() || !patient || started.elapsed() > Duration::from_secs(30) {
            let count = found.len();
            return ensure(found.is_empty(), || {
                format!("{count} things are left, such as {}", found[0])
            });
        }
        let output = run_orchestrator(&["doctor", "--remove"]);
        ensure(output.code == Some(0), || format!("doctor --remove: {output:?}"))?;
        if !left().is_empty() {
            std::thread::sleep(Duration::from_millis(200));
        }
    }
}
