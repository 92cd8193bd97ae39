//! The folder of a campaign: its identity, the journal of its results, and the process that holds it.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};
use tape::folder::private_dir_builder;

use super::identity::{Identity, default_root, io_error};
use super::journal::{self, Journal};
use crate::campaign::options::Options;
use crate::campaign::workers::point::Result as PointResult;
use crate::campaign::{Campaign, CampaignError, Outcome};

/// The process that holds a folder: the content of its file `lock`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// The machine.
    pub node: String,
    /// The process ID on it.
    pub pid: u32,
    /// Number of points that it runs side by side.
    pub workers: usize,
}

/// How the names of temporary run folders begin.
const SCRATCH: &str = ".worker-";

/// A campaign's folder, locked by this process.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    journal: Journal,
    // Kept open for its lock.
    lock: File,
}

/// The results in a folder.
#[derive(Debug, Default)]
pub struct JournaledResults {
    /// The result of each point.
    pub results: Vec<Option<PointResult>>,
    /// Points of the preceding shard that were run for comparison.
    pub audited: BTreeSet<usize>,
}

fn refusal(root: &Path, reason: impl Into<String>) -> CampaignError {
    CampaignError::Folder {
        path: root.to_owned(),
        reason: reason.into(),
    }
}

/// Whether the folder contains anything but the remains of a start that was killed before it had written the identity.
fn is_occupied(root: &Path) -> bool {
    let is_start_remnant =
        |name: &str| ["lock", "points.jsonl", "points.jsonl.part", "campaign.json.part"].contains(&name);
    let mut entries = fs::read_dir(root).into_iter().flatten().flatten();
    entries.any(|entry| !entry.file_name().to_str().is_some_and(is_start_remnant))
}

/// Locks the folder for this process.
fn lock(root: &Path) -> Result<File, CampaignError> {
    let path = root.join("lock");
    let file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(&path)
        .map_err(io_error(&path, "create the file"))?;
    if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
        let reason = "is being worked in by another campaign: wait, or name another with --out";
        return Err(refusal(root, reason));
    }
    Ok(file)
}

/// The process that holds the folder `root` now.
pub fn holder(root: &Path) -> Option<Holder> {
    let path = root.join("lock");
    let file = File::open(&path).ok()?;
    if flock(&file, FlockOperation::NonBlockingLockShared).is_ok() {
        return None;
    }
    let unknown = Holder {
        node: String::new(),
        pid: 0,
        workers: 1,
    };
    let text = fs::read_to_string(&path).unwrap_or_default();
    Some(serde_json::from_str(&text).unwrap_or(unknown))
}

impl Folder {
    /// Creates the folder of `campaign` with the identity `identity`, or opens the existing one if it is of the same
    /// campaign, or of one with fewer of its points. Returns the results in it.
    ///
    /// # Errors
    /// When it belongs to something else, or another process holds it.
    pub fn open(
        campaign: &Campaign,
        identity: &Identity,
        options: &Options,
    ) -> Result<(Folder, JournaledResults), CampaignError> {
        Folder::lock_at(&Folder::path_of(campaign, identity, options), campaign, identity)
    }

    /// The path of the folder of `campaign` with the identity `identity`, whether it exists or not.
    pub(crate) fn path_of(campaign: &Campaign, identity: &Identity, options: &Options) -> PathBuf {
        match &options.out {
            Some(out) => out.clone(),
            // The number of points is not part of the name where the campaign may grow.
            None if options.grows => default_root(identity, &identity.digest_of(campaign, 1)),
            None => default_root(identity, &identity.digest),
        }
    }

    /// Locks the folder `root` for `campaign` with the identity `identity`.
    ///
    /// # Errors
    /// As [`Folder::open`].
    pub(crate) fn lock_at(
        root: &Path,
        campaign: &Campaign,
        identity: &Identity,
    ) -> Result<(Folder, JournaledResults), CampaignError> {
        if root.exists() && !root.is_dir() {
            return Err(refusal(root, "is not a folder: name a new one with --out"));
        }
        // In this order: a process that creates the folder at the same moment begins with that file.
        if is_occupied(root) && !root.join("campaign.json").exists() {
            return Err(refusal(
                root,
                "is not empty and no campaign's: name a new folder with --out",
            ));
        }
        let created = private_dir_builder().recursive(true).create(root);
        created.map_err(io_error(root, "create the folder"))?;
        let lock = lock(root)?;
        if root.join("campaign.json").exists() {
            let known = Identity::read(root)?;
            known
                .check_can_become(identity, campaign)
                .map_err(|reason| refusal(root, reason))?;
            // Damaged points are written anew as well.
            if known != *identity || !identity.has_rows(root, campaign) {
                identity.write(root, campaign)?;
            }
        } else {
            identity.write(root, campaign)?;
        }
        let mut known = JournaledResults {
            results: vec![None; campaign.points.len()],
            audited: BTreeSet::new(),
        };
        let journal = Journal::open(root, |entry| known.apply(entry, identity))?;
        let root = root.to_owned();
        let folder = Folder { root, journal, lock };
        folder.remove_leftovers(&known.results)?;
        Ok((folder, known))
    }

    /// Records in the folder which process holds it.
    pub(crate) fn write_holder(&mut self, workers: usize) -> Result<(), CampaignError> {
        let holder = Holder {
            node: journal::node(),
            pid: std::process::id(),
            workers,
        };
        let path = self.root.join("lock");
        let text =
            serde_json::to_string(&holder).map_err(|error| io_error(&path, "write the file")(error.into()))? + "\n";
        let written = self.lock.set_len(0).and_then(|()| self.lock.write_all(text.as_bytes()));
        written.map_err(io_error(&path, "write the file"))
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The run folder of point number `point`, from 1.
    pub fn run_folder(&self, point: usize) -> PathBuf {
        self.root.join("runs").join(format!("{point:05}"))
    }

    /// Whether the run folder of point number `point`, from 1, is there and complete: the summary is its last file.
    pub fn has_run(&self, point: usize) -> bool {
        self.run_folder(point).join("summary.json").is_file()
    }

    /// The path where worker number `worker` may make a temporary run folder.
    pub fn scratch(&self, worker: usize) -> PathBuf {
        self.root.join(format!("{SCRATCH}{worker}"))
    }

    /// Removes what a campaign that was killed left behind: temporary run folders, and incomplete ones of points that are
    /// still to be run or ran to their ends. The folder of a run that failed may have no summary, and stays.
    fn remove_leftovers(&self, results: &[Option<PointResult>]) -> Result<(), CampaignError> {
        let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
        let scratch = entries(&self.root).filter(|entry| entry.file_name().to_string_lossy().starts_with(SCRATCH));
        let incomplete = entries(&self.root.join("runs")).filter(|entry| {
            let number = entry.file_name().to_str().and_then(|name| name.parse::<usize>().ok());
            let Some(result) = number.and_then(|number| results.get(number.checked_sub(1)?)) else {
                return false;
            };
            let over = result.as_ref().is_none_or(|result| result.outcome.ran());
            over && !entry.path().join("summary.json").exists()
        });
        for path in scratch.chain(incomplete).map(|entry| entry.path()) {
            fs::remove_dir_all(&path).map_err(io_error(&path, "remove the incomplete run folder"))?;
        }
        Ok(())
    }

    /// Appends the result of a point, from 1, to the journal; it has been handed to the operating system when this returns.
    pub fn append_result(
        &self,
        campaign: &Campaign,
        point: usize,
        audit: bool,
        result: &PointResult,
    ) -> Result<(), CampaignError> {
        self.journal.append(point, campaign.values(point - 1), audit, result)
    }

    /// Appends a result from another machine to the journal.
    pub(crate) fn append_foreign_result(
        &self,
        campaign: &Campaign,
        point: usize,
        node: &str,
        result: &PointResult,
    ) -> Result<(), CampaignError> {
        let entry = journal::JournalEntry {
            point,
            values: campaign.values(point - 1),
            node: node.to_owned(),
            audit: false,
            result: result.clone(),
        };
        self.journal.append_entry(&entry)
    }

    /// Writes a file of the folder atomically.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<PathBuf, CampaignError> {
        let path = self.root.join(name);
        tape::write_atomic(&path, content).map_err(io_error(&path, "write the file"))?;
        Ok(path)
    }
}

impl JournaledResults {
    /// Applies an entry of the journal. A point that crashed is run again: the machine may have caused the crash.
    fn apply(&mut self, entry: journal::JournalEntry, identity: &Identity) {
        let Some(at) = entry.point.checked_sub(1).filter(|at| *at < self.results.len()) else {
            return;
        };
        let crashed = entry.result.outcome == Outcome::Crashed;
        if entry.audit {
            if !crashed {
                self.audited.insert(at);
            }
        } else if identity.owns(at) {
            self.results[at] = (!crashed).then_some(entry.result);
        }
    }
}
