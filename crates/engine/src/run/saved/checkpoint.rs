//! Checkpoints: the state of a run at one instant, in one file.
//!
//! A checkpoint holds only what is stored nowhere else: the state and the position of every participant. The samples in transit on
//! the links follow from the plan and the tape; random samples follow from seed, name and index. Where the tape does not have every
//! sample, the checkpoint also has those that are still needed.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use lockstep::plan::{Cut, Plan};
use lockstep::time::Rational;
use lockstep::wire::{self, WireError};
use serde::{Deserialize, Serialize};
use tape::Digest;

use super::off_tape::OffTapeState;
use crate::scenario::Entry;

const MAGIC: &[u8] = b"escapement checkpoint 1\n";
/// The format that also has the samples missing on the tape.
const MAGIC_OFF_TAPE: &[u8] = b"escapement checkpoint 2\n";
const DIGEST: usize = 32;

/// The message for a participant that must save its state and has no `save`, with the remedy.
pub(crate) fn cannot_save() -> String {
    save_failed("implement `save` and `restore`, or run without")
}

/// The message for a participant that can save its state, and failed to.
pub(crate) fn save_failed(reason: &str) -> String {
    format!("cannot save its state, which a checkpoint or a substitution with state needs: {reason}")
}

/// The extension of a checkpoint's file.
const EXTENSION: &str = ".checkpoint";

/// The state of a paused run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The program that saved it.
    pub version: String,
    /// The instant: all participants have done exactly the activations before it.
    pub time: Rational,
    /// The participants, in the order of the plan.
    pub participants: Vec<String>,
    /// The position of each of them.
    pub cut: Cut,
    /// The state of each of them.
    pub states: Vec<Vec<u8>>,
    /// How many of the scenario's substitutions had taken place.
    pub substitutions: u64,
    /// For each participant, whether it had failed and had been replaced by another program of its `on-failure`.
    pub replaced: Vec<bool>,
    /// What the tape does not have, if it does not have every sample.
    #[serde(skip)]
    pub off_tape: Option<OffTapeState>,
}

/// Why a checkpoint cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file system reported an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// Another kind of file, or another version of the format.
    #[error("{}: this is not a checkpoint that this version can read (it begins with other bytes)", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Bytes were changed or are missing in the file.
    #[error("{}: the checkpoint is damaged ({reason}); take the file from another copy", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// The states are too large.
    #[error("the checkpoint at t = {time}: {source}: keep the states of the participants smaller, or run without")]
    TooLarge {
        /// Its instant.
        time: Rational,
        /// The error of the encoder.
        source: Box<WireError>,
    },
    /// There is no suitable file.
    #[error("{}: there is no checkpoint{at}{available} (checkpoints are made with --checkpoint-every and --checkpoint-at)", folder.display())]
    None {
        /// The folder of the checkpoints.
        folder: PathBuf,
        /// What was requested, in words.
        at: String,
        /// What there is, in words.
        available: String,
    },
}

impl Checkpoint {
    /// The state of a run of `plan` at `time`, with `entries` in the slots; the participants are at `cut` and have these states.
    pub fn new(
        plan: &Plan,
        time: Rational,
        cut: Cut,
        states: Vec<Vec<u8>>,
        substituted: usize,
        entries: &[Entry],
    ) -> Checkpoint {
        Checkpoint {
            version: env!("CARGO_PKG_VERSION").into(),
            time,
            participants: plan.participants.iter().map(|planned| planned.name.clone()).collect(),
            cut,
            states,
            substitutions: substituted as u64,
            replaced: entries.iter().map(|entry| entry.replaced).collect(),
            off_tape: None,
        }
    }

    /// The bytes of a checkpoint's file.
    ///
    /// # Errors
    /// [`CheckpointError::TooLarge`].
    pub fn encode(&self) -> Result<Vec<u8>, CheckpointError> {
        let time = self.time;
        let (magic, body) = match &self.off_tape {
            None => (MAGIC, wire::encode("a checkpoint", self)),
            Some(off_tape) => (MAGIC_OFF_TAPE, wire::encode("a checkpoint", &(self, off_tape))),
        };
        let body = body.map_err(|error| {
            let source = Box::new(error);
            CheckpointError::TooLarge { time, source }
        })?;
        let mut bytes = magic.to_vec();
        bytes.extend_from_slice(Digest::of(&body).as_bytes());
        bytes.extend_from_slice(&body);
        Ok(bytes)
    }

    /// Decodes the checkpoint in the bytes of the file `path`, which may hold anything.
    ///
    /// # Errors
    /// [`CheckpointError::Foreign`] and [`CheckpointError::Damaged`].
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Checkpoint, CheckpointError> {
        let path = path.to_owned();
        let (plain, more) = (bytes.strip_prefix(MAGIC), bytes.strip_prefix(MAGIC_OFF_TAPE));
        let Some(rest) = plain.or(more) else {
            return Err(CheckpointError::Foreign { path });
        };
        let damaged = |reason: String| CheckpointError::Damaged {
            path: path.clone(),
            reason,
        };
        let Some((digest, body)) = rest.split_at_checked(DIGEST) else {
            return Err(damaged("it ends in its checksum".into()));
        };
        if Digest::of(body).as_bytes() != digest {
            return Err(damaged("its checksum does not fit its contents".into()));
        }
        let decoded = match more {
            None => wire::decode("a checkpoint", body),
            Some(_) => {
                wire::decode::<(Checkpoint, OffTapeState)>("a checkpoint", body).map(|(checkpoint, off_tape)| {
                    Checkpoint {
                        off_tape: Some(off_tape),
                        ..checkpoint
                    }
                })
            }
        };
        let checkpoint: Checkpoint = decoded.map_err(|error| damaged(error.to_string()))?;
        let count = checkpoint.participants.len();
        if [
            checkpoint.states.len(),
            checkpoint.cut.next.len(),
            checkpoint.replaced.len(),
        ] != [count; 3]
        {
            return Err(damaged(
                "it does not have one state and one place for each participant".into(),
            ));
        }
        Ok(checkpoint)
    }

    /// Writes it into `folder`, completely or not at all. Returns the file.
    pub fn write(&self, folder: &Path) -> Result<PathBuf, CheckpointError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| CheckpointError::Io { path, source }
        };
        fs::create_dir_all(folder).map_err(io(folder))?;
        let name = self.time.to_string().replace(' ', "").replace('/', "-");
        let path = folder.join(format!("{name}{EXTENSION}"));
        tape::write_atomic(&path, self.encode()?).map_err(io(&path))?;
        Ok(path)
    }

    /// The newest checkpoint in `folder` at or before `limit`, and why other files in it cannot be read: any of them may be a newer one.
    ///
    /// # Errors
    /// When there is none, or when the only ones that may be suitable cannot be read.
    pub fn find(folder: &Path, limit: Option<Rational>) -> Result<(Checkpoint, Vec<CheckpointError>), CheckpointError> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let paths = entries.map(|entry| entry.path());
        let mut all = Vec::new();
        for path in paths.filter(|path| path.to_string_lossy().ends_with(EXTENSION)) {
            let bytes = tape::read_regular(&path).map_err(|source| CheckpointError::Io {
                path: path.clone(),
                source,
            })?;
            all.push((path, bytes));
        }
        all.sort();
        // The time of a damaged file is unknown.
        let (mut readable, mut unreadable) = (Vec::new(), Vec::new());
        for (path, bytes) in &all {
            match Checkpoint::decode(path, bytes) {
                Ok(checkpoint) => readable.push(checkpoint),
                Err(error) => unreadable.push(error),
            }
        }
        readable.sort_by_key(|checkpoint| checkpoint.time);
        let times: Vec<String> = readable.iter().map(|one| one.time.to_string()).collect();
        let fits = |one: &Checkpoint| limit.is_none_or(|limit| one.time <= limit);
        match (readable.into_iter().rev().find(fits), unreadable.pop()) {
            (Some(checkpoint), last) => {
                unreadable.extend(last);
                Ok((checkpoint, unreadable))
            }
            (None, Some(last)) => Err(last),
            (None, None) => Err(CheckpointError::None {
                folder: folder.to_owned(),
                at: limit.map(|limit| format!(" at or before {limit}")).unwrap_or_default(),
                available: if times.is_empty() {
                    String::new()
                } else {
                    format!("; there is one at {}", times.join(", "))
                },
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::plan::InFlightSample;

    fn checkpoint() -> Checkpoint {
        Checkpoint {
            version: "1".into(),
            time: Rational::from_millis(12_500),
            participants: vec!["a".into(), "b".into()],
            cut: Cut { next: vec![3, 4] },
            states: vec![vec![1, 2, 3], Vec::new()],
            substitutions: 1,
            replaced: vec![false, true],
            off_tape: None,
        }
    }

    fn with_off_tape_state() -> Checkpoint {
        let sample = InFlightSample {
            index: 7,
            payload: vec![5, 6],
        };
        let off_tape = OffTapeState {
            counts: vec![2, 9],
            samples: vec![vec![sample], Vec::new()],
            assessment: Some(vec![1]),
            guards: vec![("0".into(), Some((vec![3], 4))), ("1".into(), None)],
        };
        Checkpoint {
            off_tape: Some(off_tape),
            ..checkpoint()
        }
    }

    #[test]
    fn checkpoint_decodes_to_what_was_encoded() {
        for checkpoint in [checkpoint(), with_off_tape_state()] {
            let bytes = checkpoint.encode().unwrap();
            assert_eq!(Checkpoint::decode(Path::new("x"), &bytes).unwrap(), checkpoint);
        }
    }

    #[test]
    fn find_returns_newest_checkpoint_and_unreadable_files() {
        let folder = std::env::temp_dir().join(format!("escapement-checkpoints-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let of = |millis: i64| Checkpoint {
            time: Rational::from_millis(millis),
            ..checkpoint()
        };
        let newest = of(3_000).write(&folder).unwrap();
        let middle = of(2_000).write(&folder).unwrap();
        of(1_000).write(&folder).unwrap();
        let found = |limit: Option<i64>| Checkpoint::find(&folder, limit.map(Rational::from_millis));
        let (checkpoint, unreadable) = found(None).unwrap();
        assert_eq!((checkpoint, unreadable.len()), (of(3_000), 0));
        fs::write(&newest, "nothing of the kind").unwrap();
        fs::write(&middle, &of(2_000).encode().unwrap()[..60]).unwrap();
        let (checkpoint, unreadable) = found(None).unwrap();
        assert_eq!(checkpoint, of(1_000));
        let messages: Vec<String> = unreadable.iter().map(ToString::to_string).collect();
        let parts = [(&middle, "damaged"), (&newest, "not a checkpoint")];
        assert_eq!(messages.len(), parts.len());
        for (words, (path, part)) in messages.iter().zip(parts) {
            let path = path.display().to_string();
            assert!(words.contains(&path) && words.contains(part), "{words}");
        }
        let error = found(Some(500)).unwrap_err().to_string();
        assert!(error.contains(&newest.display().to_string()), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn folder_in_place_of_checkpoint_is_reported_with_path() {
        let folder = std::env::temp_dir().join(format!("escapement-no-checkpoint-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let path = checkpoint().write(&folder).unwrap();
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        let error = Checkpoint::find(&folder, None).unwrap_err().to_string();
        let named = error.contains(&path.display().to_string());
        assert!(named && error.contains("not a regular file"), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn decoder_detects_every_changed_byte_and_truncation() {
        let all = [checkpoint(), with_off_tape_state()].map(|checkpoint| checkpoint.encode().unwrap());
        for (bytes, at) in all.iter().flat_map(|bytes| (0..bytes.len()).map(move |at| (bytes, at))) {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            assert!(Checkpoint::decode(Path::new("x"), &changed).is_err(), "byte {at}");
            assert!(Checkpoint::decode(Path::new("x"), &bytes[..at]).is_err(), "cut at {at}");
        }
    }
}
