//! The run folder: everything one run leaves behind, in one place.
//!
//! ```text
//! plan.toml                  the scenario with every default filled in
//! run.json                   versions, host, command line, files
//! summary.json               verdict and figures of merit
//! log/<participant>.stderr   what each participant said
//! tape/                      see `tape`
//! ```

mod claim;

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;

pub use claim::Claim;
use claim::outermost_missing;

/// A run folder that exists.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    root: PathBuf,
}

/// Why a run folder cannot be made or written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The folder has something in it.
    #[error("{} is not empty: name a new folder with `--out`; `--force` replaces what is in it, if that is a run", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// What is in the folder is no run, or not a run alone.
    #[error("{} is not replaced: {reason}; name a new folder with `--out`", path.display())]
    NotARun {
        /// The folder.
        path: PathBuf,
        /// What is there, or is not.
        reason: String,
    },
    /// There is something of that name which is not a folder.
    #[error("{} is not a folder: name a new one with `--out`", path.display())]
    NotAFolder {
        /// The path.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
}

fn io_error(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    move |source| FolderError::Io { path, action, source }
}

/// Makes folders for the user alone, whatever the user's mask says: what a run holds is for others only when its owner opens it to
/// them.
pub fn private() -> DirBuilder {
    let mut builder = DirBuilder::new();
    builder.mode(0o700);
    builder
}

impl RunFolder {
    /// Makes the folder `root` with its parents, for the user alone, or takes an empty one as it is; refuses one that has anything
    /// in it.
    pub fn create(root: &Path) -> Result<RunFolder, FolderError> {
        Claim::of(root, false).map(Claim::keep)
    }

    /// Makes `<runs>/<scenario>-<UTC time>-<n>` with the first n from 1 that is free. Runs that start in the same instant
    /// get different folders: whoever creates it has it.
    pub fn create_default(runs: &Path, scenario: &str) -> Result<Claim, FolderError> {
        let outermost = outermost_missing(runs);
        private()
            .recursive(true)
            .create(runs)
            .map_err(io_error(runs, "create the folder"))?;
        let plain: String = scenario
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' })
            .collect();
        let plain = if plain.is_empty() { "run" } else { &plain };
        let time = utc_compact(SystemTime::now());
        let mut n = 1_u32;
        loop {
            let root = runs.join(format!("{plain}-{time}-{n}"));
            match private().create(&root) {
                Ok(()) => return Claim::made(&root, Some(outermost.unwrap_or_else(|| root.clone()))),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
                Err(error) => return Err(io_error(&root, "create the folder")(error)),
            }
        }
    }

    /// Takes a folder as it is; nothing needs to be in it.
    pub fn open(root: &Path) -> RunFolder {
        RunFolder { root: root.to_owned() }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The scenario with every default filled in.
    pub fn plan(&self) -> PathBuf {
        self.root.join("plan.toml")
    }

    /// Versions, host, command line, files.
    pub fn run(&self) -> PathBuf {
        self.root.join("run.json")
    }

    /// Verdict and figures of merit.
    pub fn summary(&self) -> PathBuf {
        self.root.join("summary.json")
    }

    /// The tape's folder; [`crate::Writer::create`] makes it.
    pub fn tape(&self) -> PathBuf {
        self.root.join("tape")
    }

    /// The folder of the checkpoints; there when the first one is.
    pub fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }

    /// Where a participant's standard error goes.
    pub fn stderr(&self, participant: &str) -> PathBuf {
        self.root.join("log").join(format!("{participant}.stderr"))
    }

    /// Writes `text` to `path`, a path of this folder, so that it is there whole or not at all.
    pub fn write(&self, path: &Path, text: &str) -> Result<(), FolderError> {
        let mut draft = path.as_os_str().to_owned();
        draft.push(".part");
        let draft = PathBuf::from(draft);
        let written = fs::write(&draft, text).and_then(|()| fs::rename(&draft, path));
        written.map_err(|error| {
            let _ = fs::remove_file(&draft);
            io_error(path, "write the file")(error)
        })
    }

    /// Writes `content` as indented JSON, like [`RunFolder::write`].
    pub fn write_json(&self, path: &Path, content: &impl Serialize) -> Result<(), FolderError> {
        let mut text = serde_json::to_string_pretty(content)
            .map_err(io::Error::from)
            .map_err(io_error(path, "put the content into JSON"))?;
        text.push('\n');
        self.write(path, &text)
    }
}

/// Year, month, day, hour, minute, second of an instant in UTC.
fn civil(time: SystemTime) -> (i64, i64, i64, i64, i64, i64) {
    let seconds = match time.duration_since(UNIX_EPOCH) {
        Ok(after) => after.as_secs() as i64,
        Err(before) => -(before.duration().as_secs() as i64) - i64::from(before.duration().subsec_nanos() > 0),
    };
    let (days, of_day) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // Years run from March to February here, so that the leap day is the last of its year; 400 of them are 146,097 days.
    let from_march = days + 719_468;
    let (era, of_era) = (from_march.div_euclid(146_097), from_march.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    (year, month, day, of_day / 3600, of_day / 60 % 60, of_day % 60)
}

/// An instant for names of folders: `20261122T014819Z`.
pub fn utc_compact(time: SystemTime) -> String {
    let (year, month, day, hour, minute, second) = civil(time);
    format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
}

/// An instant for people and files (RFC 3339, whole seconds): `2026-11-22T01:48:19Z`.
pub fn utc_text(time: SystemTime) -> String {
    let (year, month, day, hour, minute, second) = civil(time);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn check(seconds: i64, text: &str) {
        let time = if seconds < 0 {
            UNIX_EPOCH - Duration::from_secs(seconds.unsigned_abs())
        } else {
            UNIX_EPOCH + Duration::from_secs(seconds as u64)
        };
        assert_eq!(utc_text(time), text);
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        check(0, "1970-01-01T00:00:00Z");
        check(-1, "1969-12-31T23:59:59Z");
        check(951_782_400, "2000-02-29T00:00:00Z");
        check(1_795_312_099, "2026-11-22T01:48:19Z");
        check(4_107_542_400, "2100-03-01T00:00:00Z");
        assert_eq!(utc_compact(UNIX_EPOCH), "19700101T000000Z");
    }

    #[test]
    fn a_folder_with_something_in_it_is_refused_and_left_alone() {
        let root = crate::scratch_for_tests("folder");
        let first = RunFolder::create(&root).unwrap();
        first.write_json(&first.run(), &serde_json::json!({"a": 1})).unwrap();
        let text = RunFolder::create(&root).unwrap_err().to_string();
        assert!(text.contains("not empty") && text.contains("--out"), "{text}");
        assert!(first.run().is_file());
        let error = RunFolder::create(&first.run()).unwrap_err();
        assert!(matches!(error, FolderError::NotAFolder { .. }), "{error}");
    }

    #[test]
    fn runs_of_the_same_instant_never_meet() {
        let runs = crate::scratch_for_tests("runs");
        let roots: Vec<PathBuf> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..8)
                .map(|_| {
                    scope.spawn(|| {
                        (0..20)
                            .map(|_| RunFolder::create_default(&runs, "a/b é").unwrap())
                            .map(|claim| claim.keep().root().to_owned())
                            .collect::<Vec<_>>()
                    })
                })
                .collect();
            threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
        });
        let unique: std::collections::HashSet<_> = roots.iter().collect();
        assert_eq!(unique.len(), 160);
        assert!(roots.iter().all(|root| root.parent() == Some(runs.as_path())));
    }
}
