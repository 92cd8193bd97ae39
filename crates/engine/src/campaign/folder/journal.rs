//! Journal of a campaign's folder: a line for each result, in order of arrival.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::identity::io_error;
use crate::campaign::CampaignError;
use crate::campaign::workers::point::Result as PointResult;

/// Values of a point by the names of their columns.
pub type Values = serde_json::Map<String, serde_json::Value>;

/// A line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JournalEntry {
    /// From 1.
    pub point: usize,
    /// The labels of the point, by column.
    #[serde(default)]
    pub values: Values,
    /// The machine that ran it.
    #[serde(default)]
    pub node: String,
    /// Whether the point belongs to another shard and was run for comparison.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub audit: bool,
    /// The result.
    #[serde(flatten)]
    pub result: PointResult,
}

/// The name of this machine: from the engine that started the program, where it gives one.
pub fn node() -> String {
    std::env::var("SLURMD_NODENAME")
        .unwrap_or_else(|_| rustix::system::uname().nodename().to_string_lossy().into_owned())
}

/// The journal's name in a campaign's folder.
pub(crate) fn path(root: &Path) -> PathBuf {
    root.join("results.jsonl")
}

/// The journal of a folder, open for appending.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    node: String,
}

impl Journal {
    /// Opens the journal of the folder `root` behind its last complete line; `take` gets each entry in it.
    pub(crate) fn open(root: &Path, visit: impl FnMut(JournalEntry)) -> Result<Journal, CampaignError> {
        let path = path(root);
        let complete_bytes = for_each_entry(&path, visit)?;
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .map_err(io_error(&path, "open the file"))?;
        file.set_len(complete_bytes)
            .map_err(io_error(&path, "shorten the file"))?;
        Ok(Journal {
            path,
            file,
            node: node(),
        })
    }

    /// Appends a result of this machine for the point with these values; it has been handed to the operating system when
    /// this returns.
    pub(crate) fn append(
        &self,
        point: usize,
        values: Values,
        audit: bool,
        result: &PointResult,
    ) -> Result<(), CampaignError> {
        self.append_entry(&JournalEntry {
            point,
            values,
            node: self.node.clone(),
            audit,
            result: result.clone(),
        })
    }

    /// Appends a line.
    pub(crate) fn append_entry(&self, entry: &JournalEntry) -> Result<(), CampaignError> {
        let line = line_of(entry).map_err(|error| io_error(&self.path, "write the file")(error.into()))?;
        (&self.file)
            .write_all(line.as_bytes())
            .map_err(io_error(&self.path, "write the file"))
    }
}

/// The text before the check of a line, which is its last key.
const CHECK: &[u8] = b",\"check\":\"";

/// Number of hexadecimal digits of the check of a line: of 65 536 lines with a change, one is taken for unchanged.
const CHECK_DIGITS: usize = 4;

/// The check of a line that begins with `bytes`.
fn check_of(bytes: &[u8]) -> String {
    let mut digest = tape::Digest::of(bytes).to_string();
    digest.truncate(CHECK_DIGITS);
    digest
}

/// The line of an entry, with its check.
fn line_of(entry: &JournalEntry) -> serde_json::Result<String> {
    let mut line = serde_json::to_string(entry)?;
    line.pop();
    let check = check_of(line.as_bytes());
    Ok(format!("{line},\"check\":\"{check}\"}}\n"))
}

/// Whether the check of `line` agrees with it. A line without one is one of an earlier version, or was written by hand.
fn agrees(line: &[u8]) -> bool {
    let Some(line) = line.strip_suffix(b"\"}\n") else {
        return true;
    };
    let Some((line, check)) = line.split_at_checked(line.len().saturating_sub(CHECK_DIGITS)) else {
        return true;
    };
    line.strip_suffix(CHECK)
        .is_none_or(|line| check_of(line).as_bytes() == check)
}

/// The error of line `number` of the journal at `path`.
fn bad_line(path: &Path, number: usize, reason: &str) -> CampaignError {
    CampaignError::Folder {
        path: path.to_owned(),
        reason: format!(
            "line {number} {reason}: remove the line, and run the campaign again, which runs its point again"
        ),
    }
}

/// Passes on the entries of the journal at `path` up to the last complete line; returns the length up to there, bytes. A
/// missing file is an empty journal.
pub(crate) fn for_each_entry(path: &Path, mut visit: impl FnMut(JournalEntry)) -> Result<u64, CampaignError> {
    let file = match fs::File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        Err(error) => return Err(io_error(path, "read the file")(error)),
    };
    let (mut reader, mut line, mut complete_bytes) = (BufReader::with_capacity(1 << 16, file), Vec::new(), 0);
    let mut number = 0_usize;
    loop {
        line.clear();
        let length = reader
            .read_until(b'\n', &mut line)
            .map_err(io_error(path, "read the file"))?;
        number += 1;
        if !line.ends_with(b"\n") {
            return Ok(complete_bytes);
        }
        let entry = match serde_json::from_slice(&line) {
            Ok(entry) => entry,
            // The last line, written incompletely when the machine failed.
            Err(_) if reader.fill_buf().map_err(io_error(path, "read the file"))?.is_empty() => {
                return Ok(complete_bytes);
            }
            Err(error) => {
                let reason = format!("is no result, and there are results behind it ({error})");
                return Err(bad_line(path, number, &reason));
            }
        };
        if !agrees(&line) {
            return Err(bad_line(path, number, "is not as it was written (its check differs)"));
        }
        complete_bytes += length as u64;
        visit(entry);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Outcome;

    #[test]
    fn torn_journal_keeps_whole_lines_and_appends_after_them() {
        let root = std::env::temp_dir().join(format!("campaign-journal-{}", std::process::id()));
        fs::create_dir_all(&root).unwrap();
        let line = |point, audit| {
            let entry = JournalEntry {
                point,
                values: Values::new(),
                node: "a".into(),
                audit,
                result: PointResult::without(Outcome::Failed, "why"),
            };
            serde_json::to_string(&entry).unwrap() + "\n"
        };
        let whole = line(2, false) + &line(9, true);
        fs::write(path(&root), format!("{whole}{}", &line(3, false)[..20])).unwrap();
        let mut read = Vec::new();
        let journal = Journal::open(&root, |entry| read.push((entry.point, entry.audit))).unwrap();
        assert_eq!(read, [(2, false), (9, true)]);
        journal
            .append(3, Values::new(), false, &PointResult::without(Outcome::Refused, ""))
            .unwrap();
        read.clear();
        let mut node = String::new();
        for_each_entry(&path(&root), |entry| {
            read.push((entry.point, entry.audit));
            node = entry.node;
        })
        .unwrap();
        assert_eq!(read, [(2, false), (9, true), (3, false)]);
        // A line of which nothing can be read loses no result behind it.
        fs::write(path(&root), line(2, false) + "garbage\n" + &line(9, true)).unwrap();
        let refused = for_each_entry(&path(&root), |_| {}).unwrap_err();
        assert_eq!(refused.exit_code(), 2, "the user must change the file");
        let refused = refused.to_string();
        assert!(
            refused.contains("results.jsonl") && refused.contains("line 2"),
            "{refused}"
        );
        fs::write(path(&root), line(2, false) + "garbage\n").unwrap();
        assert_eq!(
            for_each_entry(&path(&root), |_| {}).unwrap(),
            line(2, false).len() as u64
        );
        assert!(!node.is_empty() && node != "a", "{node}");
        fs::remove_dir_all(&root).unwrap();
    }

    #[test]
    fn changed_line_of_journal_is_rejected_wherever_it_is() {
        let root = std::env::temp_dir().join(format!("campaign-journal-check-{}", std::process::id()));
        fs::create_dir_all(&root).unwrap();
        let entry = JournalEntry {
            point: 7,
            values: Values::new(),
            node: "a".into(),
            audit: false,
            result: PointResult::without(Outcome::Failed, "after 1.25 s"),
        };
        let line = line_of(&entry).unwrap();
        let mut read = Vec::new();
        let mut read_journal = |text: &str| {
            fs::write(path(&root), text).unwrap();
            for_each_entry(&path(&root), |entry| read.push(entry))
                .map_err(|error| (error.exit_code(), error.to_string()))
        };
        read_journal(&line).unwrap();
        for (text, number) in [
            (line.replace("1.25", "1.35"), 1),
            (line.clone() + &line.replace("\"point\":7", "\"point\":8"), 2),
        ] {
            let (code, error) = read_journal(&text).unwrap_err();
            assert_eq!(code, 2, "{error}");
            assert!(
                error.contains(&format!("results.jsonl: line {number} is not as it was written")),
                "{error}"
            );
        }
        // The lines of earlier versions have no check.
        read_journal(&(serde_json::to_string(&entry).unwrap() + "\n")).unwrap();
        assert!(read.iter().filter(|one| **one == entry).count() >= 2);
        fs::remove_dir_all(&root).unwrap();
    }
}
