//! A campaign's folder: what it is of, the journal of its results, and who works in it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};
use tape::Digest;
use tape::folder::private;

use super::point::Result as PointResult;
use super::{Campaign, CampaignError};
use crate::scenario::Scenario;

/// Which command makes a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// `sweep`
    Sweep,
    /// `faults`
    Faults,
}

impl Kind {
    /// Where its folders lie unless the user says.
    fn parent(self) -> &'static str {
        match self {
            Kind::Sweep => "sweeps",
            Kind::Faults => "faults",
        }
    }
}

/// `campaign.json`: what the folder is of.
#[derive(Debug, Serialize, Deserialize)]
struct Identity {
    kind: Kind,
    scenario: String,
    /// Of the program, the scenario with its files, and the points.
    digest: Digest,
    version: String,
    points: usize,
}

/// A line of the journal.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    /// From 1.
    point: usize,
    /// What tells the point apart, by column.
    #[serde(default)]
    values: serde_json::Map<String, serde_json::Value>,
    #[serde(flatten)]
    result: PointResult,
}

/// A campaign's folder that nobody else works in.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    journal: File,
    // Held for its lock.
    _lock: File,
}

fn failed(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> CampaignError {
    let path = path.to_owned();
    move |source| CampaignError::Io { path, action, source }
}

/// The digest of a scenario as it was read, with the contents of its files.
pub fn digest_of_scenario(scenario: &Scenario) -> Digest {
    blake3::hash(scenario.resolved().to_string().as_bytes()).into()
}

/// The digest of everything that the results depend on.
fn digest(campaign: &Campaign, scenario: &Scenario) -> std::result::Result<Digest, CampaignError> {
    let mut hasher = blake3::Hasher::new_derive_key("escapement campaign 1");
    let mut part = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    // Results of two builds of the program must not stand in one table; nor those of somebody's program before and after.
    let mut programs = vec![PathBuf::from("/proc/self/exe")];
    programs.extend(
        scenario
            .programs()
            .filter_map(|program| program.file().map(Path::to_owned)),
    );
    for program in programs {
        let bytes = fs::read(&program).map_err(failed(&program, "read the program"))?;
        part(blake3::hash(&bytes).as_bytes());
    }
    part(digest_of_scenario(scenario).as_bytes());
    for changes in &campaign.points {
        part(changes.join("\n").as_bytes());
    }
    Ok(hasher.finalize().into())
}

impl Folder {
    /// Makes the folder, or takes up what lies there if it is of the same campaign. Gives the results that are there.
    ///
    /// # Errors
    /// When it belongs to something else, or somebody works in it.
    pub fn open(
        campaign: &Campaign,
        scenario: &Scenario,
        out: Option<&Path>,
    ) -> std::result::Result<(Folder, Vec<Option<PointResult>>), CampaignError> {
        let digest = digest(campaign, scenario)?;
        let root = out.map_or_else(
            || {
                let name: String = scenario
                    .name
                    .chars()
                    .map(|letter| {
                        if letter.is_ascii_alphanumeric() || letter == '_' {
                            letter
                        } else {
                            '-'
                        }
                    })
                    .collect();
                Path::new(campaign.kind.parent()).join(format!("{name}-{}", &digest.to_string()[..10]))
            },
            Path::to_owned,
        );
        let refuse = |reason: String| CampaignError::Folder {
            path: root.clone(),
            reason,
        };
        if root.exists() && !root.is_dir() {
            return Err(refuse("is not a folder: name a new one with --out".into()));
        }
        let about = root.join("campaign.json");
        let taken = fs::read_dir(&root).is_ok_and(|mut entries| entries.next().is_some());
        if taken && !about.exists() {
            return Err(refuse(
                "is not empty and no campaign's: name a new folder with --out".into(),
            ));
        }
        let made = private().recursive(true).create(&root);
        made.map_err(failed(&root, "create the folder"))?;
        let path = root.join("lock");
        let lock = File::create(&path).map_err(failed(&path, "create the file"))?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return Err(refuse(
                "is being worked in by another campaign: wait, or name another with --out".into(),
            ));
        }
        if taken {
            let text = fs::read_to_string(&about).map_err(failed(&about, "read the file"))?;
            let known: Identity = serde_json::from_str(&text).map_err(|error| {
                refuse(format!(
                    "campaign.json cannot be read ({error}): name a new folder with --out"
                ))
            })?;
            if known.digest != digest {
                return Err(refuse(format!(
                    "is of another campaign ({} points of `{}`, digest {}…): the scenario, a file of it, the points or the program \
                     is not the same; name a new folder with --out",
                    known.points,
                    known.scenario,
                    &known.digest.to_string()[..10],
                )));
            }
        } else {
            let identity = Identity {
                kind: campaign.kind,
                scenario: scenario.name.clone(),
                digest,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                points: campaign.points.len(),
            };
            let text = serde_json::to_string_pretty(&identity).unwrap_or_default() + "\n";
            whole(&about, &text)?;
        }
        let (journal, results) = journal(&root.join("results.jsonl"), campaign.points.len())?;
        let folder = Folder {
            root,
            journal,
            _lock: lock,
        };
        Ok((folder, results))
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The run folder of point number `point`, from 1.
    pub fn run(&self, point: usize) -> PathBuf {
        self.root.join("runs").join(format!("{point:05}"))
    }

    /// Where worker number `worker` may make a run folder for a while.
    pub fn scratch(&self, worker: usize) -> PathBuf {
        self.root.join(format!(".worker-{worker}"))
    }

    /// Puts the result of a point, from 1, into the journal: it is on the disk's way when this returns.
    pub fn note(
        &mut self,
        campaign: &Campaign,
        point: usize,
        result: &PointResult,
    ) -> std::result::Result<(), CampaignError> {
        let values = campaign
            .columns
            .iter()
            .map(|column| (column.name.clone(), column.json(point - 1)));
        let entry = Entry {
            point,
            values: values.collect(),
            result: result.clone(),
        };
        let line = serde_json::to_string(&entry).unwrap_or_default() + "\n";
        let path = self.root.join("results.jsonl");
        self.journal
            .write_all(line.as_bytes())
            .map_err(failed(&path, "write the file"))
    }

    /// Writes a file of the folder so that it is there whole or not at all.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> std::result::Result<PathBuf, CampaignError> {
        let path = self.root.join(name);
        whole(&path, content)?;
        Ok(path)
    }
}

fn whole(path: &Path, content: impl AsRef<[u8]>) -> std::result::Result<(), CampaignError> {
    tape::write_whole(path, content).map_err(failed(path, "write the file"))
}

/// Opens the journal behind its last whole line. Who crashed is run again: that may have been the machine's doing.
fn journal(path: &Path, points: usize) -> std::result::Result<(File, Vec<Option<PointResult>>), CampaignError> {
    let mut results = vec![None; points];
    let text = match fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(failed(path, "read the file")(error)),
    };
    let mut good = 0;
    for line in text.split_inclusive(|byte| *byte == b'\n') {
        let Some(entry) = line
            .ends_with(b"\n")
            .then(|| serde_json::from_slice::<Entry>(line).ok())
            .flatten()
        else {
            break;
        };
        good += line.len() as u64;
        if let Some(slot) = entry.point.checked_sub(1).and_then(|at| results.get_mut(at)) {
            *slot = (entry.result.outcome != super::Outcome::Crashed).then_some(entry.result);
        }
    }
    let journal = OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .map_err(failed(path, "open the file"))?;
    journal.set_len(good).map_err(failed(path, "shorten the file"))?;
    Ok((journal, results))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Outcome;

    #[test]
    fn a_torn_journal_gives_its_whole_lines_and_goes_on_behind_them() {
        let path = std::env::temp_dir().join(format!("campaign-journal-{}", std::process::id()));
        let line = |point, outcome| {
            let result = PointResult::without(outcome, "why");
            let values = serde_json::Map::new();
            serde_json::to_string(&Entry { point, values, result }).unwrap() + "\n"
        };
        let whole = line(2, Outcome::Failed) + &line(1, Outcome::Crashed) + &line(9, Outcome::Failed);
        fs::write(&path, format!("{whole}{}", &line(3, Outcome::Failed)[..20])).unwrap();
        let (mut file, results) = journal(&path, 3).unwrap();
        assert!(results[0].is_none(), "who crashed is run again");
        assert_eq!(results[1].as_ref().unwrap().outcome, Outcome::Failed);
        assert!(results[2].is_none());
        file.write_all(line(3, Outcome::Refused).as_bytes()).unwrap();
        let (_, results) = journal(&path, 3).unwrap();
        assert_eq!(results[2].as_ref().unwrap().outcome, Outcome::Refused);
        fs::remove_file(&path).unwrap();
    }
}
