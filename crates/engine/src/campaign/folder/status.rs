//! Progress of a campaign: of its folder, or of those of its shards.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::claim::{Holder, holder};
use super::identity::Identity;
use super::journal;
use crate::campaign::CampaignError;
use crate::campaign::workers::point::Outcome;

/// A folder of a campaign and its progress.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The folder.
    pub root: PathBuf,
    /// Its identity.
    pub identity: Identity,
    /// The number of points that it is for.
    pub own: usize,
    /// The outcomes of the points that were run.
    pub outcomes: BTreeMap<&'static str, usize>,
    /// The machines that ran them.
    pub nodes: Vec<String>,
    /// The number of points of another shard that it has run, and the number that it is to run.
    pub audits: (usize, usize),
    /// Its activity.
    pub state: State,
}

/// The activity in a folder of a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum State {
    /// All of its points have results.
    Complete,
    /// Points are being run.
    Running(Holder),
    /// Points are missing, and no process is running them.
    Stopped,
}

impl Part {
    /// The number of its points with results.
    pub fn done(&self) -> usize {
        self.outcomes.values().sum()
    }

    /// The number of its points whose runs did not reach their ends.
    pub fn failed(&self) -> usize {
        let wrong = [Outcome::Refused, Outcome::Failed, Outcome::Crashed];
        wrong
            .iter()
            .filter_map(|outcome| self.outcomes.get(outcome.word()))
            .sum()
    }

    /// The number of its points that are being run.
    pub fn running(&self) -> usize {
        let open = self.own - self.done() + self.audits.1 - self.audits.0;
        match &self.state {
            State::Running(holder) => holder.workers.min(open),
            State::Complete | State::Stopped => 0,
        }
    }

    /// The number of its shard.
    pub fn number(&self) -> Option<usize> {
        self.identity.shard.map(|shard| shard.number)
    }

    fn read(root: &Path) -> Result<Part, CampaignError> {
        let identity = Identity::read(root)?;
        let audits = |at: usize| identity.audits(at);
        let mut outcomes: Vec<Option<&'static str>> = vec![None; identity.points];
        let mut twice = vec![false; identity.points];
        let mut nodes = Vec::new();
        journal::each(&journal::path(root), |entry| {
            let Some(at) = entry.point.checked_sub(1).filter(|at| *at < identity.points) else {
                return;
            };
            if entry.audit {
                twice[at] = audits(at);
            } else if identity.owns(at) {
                outcomes[at] = Some(entry.result.outcome.word());
            }
            if !nodes.contains(&entry.node) {
                nodes.push(entry.node);
            }
        })?;
        let all = 0..identity.points;
        let mut part = Part {
            own: all.clone().filter(|at| identity.owns(*at)).count(),
            outcomes: BTreeMap::new(),
            nodes,
            audits: (
                twice.iter().filter(|twice| **twice).count(),
                all.filter(|at| audits(*at)).count(),
            ),
            state: State::Stopped,
            root: root.to_owned(),
            identity,
        };
        for word in outcomes.into_iter().flatten() {
            *part.outcomes.entry(word).or_default() += 1;
        }
        if let Some(holder) = holder(root) {
            part.state = State::Running(holder);
        } else if part.done() == part.own && part.audits.0 == part.audits.1 {
            part.state = State::Complete;
        }
        Ok(part)
    }
}

/// Every folder of a campaign in `root`: `root` itself, or those of shards in it or in its folder `shards`, by their
/// numbers.
///
/// # Errors
/// When there is no such folder, or one cannot be read.
pub fn parts(root: &Path) -> Result<Vec<Part>, CampaignError> {
    let mut parts = Vec::new();
    for folder in [root.to_owned(), root.join("shards")] {
        let mut below: Vec<PathBuf> = fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| path.join("campaign.json").is_file())
            .collect();
        below.sort();
        for path in below {
            let part = Part::read(&path)?;
            if part.identity.shard.is_some() {
                parts.push(part);
            }
        }
    }
    parts.sort_by_key(|part| part.identity.shard.map(|shard| (shard.of, shard.number)));
    // The whole campaign has its own results after merging, or where it has no shards.
    if parts.is_empty() || fs::metadata(journal::path(root)).is_ok_and(|about| about.len() > 0) {
        parts.insert(0, Part::read(root)?);
    }
    Ok(parts)
}
