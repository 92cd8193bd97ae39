//! Progress of a campaign: of its folder, or of those of its shards.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::campaign_folder::{Holder, holder};
use super::identity::Identity;
use super::journal;
use crate::campaign::CampaignError;
use crate::campaign::figures::Figures;
use crate::campaign::stopping_rule::Until;
use crate::campaign::workers::point::{Outcome, Result as PointResult};

/// A folder of a campaign and its progress.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The folder.
    pub root: PathBuf,
    /// Its identity.
    pub identity: Identity,
    /// The number of points of the campaign. The folder of a shard may be of an earlier state, with fewer points.
    pub points: usize,
    /// The number of points of the campaign that belong to it.
    pub own: usize,
    /// The outcomes of the points that were run.
    pub outcomes: BTreeMap<&'static str, usize>,
    /// The machines that ran them.
    pub nodes: Vec<String>,
    /// The number of points of another shard that it has run, and the number that it is to run.
    pub audits: (usize, usize),
    /// The number of points, from the first on, that its stopping rule finds enough.
    pub enough: Option<usize>,
    /// Its activity.
    pub state: State,
}

/// The activity in a folder of a campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum State {
    /// All of its points have results, or enough of them where it has a stopping rule.
    Complete,
    /// Points are being run.
    Running(Holder),
    /// Points are missing, and no process is running them.
    Stopped,
}

impl Part {
    /// The number of its points with results that stay: a point that crashed is run again.
    pub fn done(&self) -> usize {
        self.outcomes.values().sum::<usize>() - self.crashed()
    }

    /// The number of its points that were refused or failed: they are not run again.
    pub fn failed(&self) -> usize {
        self.count(Outcome::Refused) + self.count(Outcome::Failed)
    }

    /// The number of its points whose last run crashed.
    pub fn crashed(&self) -> usize {
        self.count(Outcome::Crashed)
    }

    fn count(&self, outcome: Outcome) -> usize {
        self.outcomes.get(outcome.name()).copied().unwrap_or(0)
    }

    /// Whether every point was run, including those that crashed: running them again may change nothing.
    pub fn is_run(&self) -> bool {
        self.done() + self.crashed() == self.own && self.audits.0 == self.audits.1
    }

    /// Whether the campaign has grown since the folder was made.
    pub fn is_outgrown(&self) -> bool {
        self.identity.points < self.points
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

    /// The folder `root` with the identity `identity`, of a campaign with `points` points by now.
    fn read(root: &Path, identity: Identity, points: usize) -> Result<Part, CampaignError> {
        let audits = |at: usize| identity.audits(at);
        let mut results: Vec<Option<PointResult>> = vec![None; points];
        let mut audited = vec![false; points];
        let mut nodes = Vec::new();
        journal::for_each_entry(&journal::path(root), |entry| {
            let Some(at) = entry.point.checked_sub(1).filter(|at| *at < points) else {
                return;
            };
            if entry.audit {
                audited[at] |= audits(at) && entry.result.outcome != Outcome::Crashed;
            } else if identity.owns(at) {
                results[at] = Some(entry.result);
            }
            if !nodes.contains(&entry.node) {
                nodes.push(entry.node);
            }
        })?;
        let all = 0..points;
        let mut part = Part {
            points,
            own: all.clone().filter(|at| identity.owns(*at)).count(),
            outcomes: BTreeMap::new(),
            nodes,
            audits: (
                audited.iter().filter(|audited| **audited).count(),
                all.filter(|at| audits(*at)).count(),
            ),
            enough: None,
            state: State::Stopped,
            root: root.to_owned(),
            identity,
        };
        for result in results.iter().flatten() {
            *part.outcomes.entry(result.outcome.name()).or_default() += 1;
        }
        part.enough = part
            .identity
            .until
            .as_ref()
            .and_then(|until| points_until_enough(until, results));
        if let Some(holder) = holder(root) {
            part.state = State::Running(holder);
        } else if part.enough.is_some() || (part.is_run() && part.crashed() == 0) {
            part.state = State::Complete;
        }
        Ok(part)
    }
}

/// The number of points, from the first on, with which the rule `until` ends a campaign that has the results `results`.
fn points_until_enough(until: &Until, mut results: Vec<Option<PointResult>>) -> Option<usize> {
    for result in &mut results {
        // A point that crashed is run again.
        result.take_if(|one| one.outcome == Outcome::Crashed);
    }
    let figures = results.iter().flatten().find_map(|result| result.figures.as_ref());
    let known = figures.map_or(Vec::new(), Figures::ordered);
    until.watch(&known).ok()?.evaluate(&results)
}

/// Every folder of a campaign in `root`: `root` itself, or those of shards in it or in its folder `shards`, by their
/// numbers.
///
/// # Errors
/// When there is no such folder, or one cannot be read.
pub fn parts(root: &Path) -> Result<Vec<Part>, CampaignError> {
    let mut shards = Vec::new();
    for folder in [root.to_owned(), root.join("shards")] {
        let mut subfolders: Vec<PathBuf> = fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(|path| path.join("campaign.json").is_file())
            .collect();
        subfolders.sort();
        for path in subfolders {
            let identity = Identity::read(&path)?;
            if identity.shard.is_some() {
                shards.push((path, identity));
            }
        }
    }
    shards.sort_by_key(|(_, identity)| identity.shard.map(|shard| (shard.of, shard.number)));
    // The whole campaign has its own results after merging, or where it has no shards.
    let merged = fs::metadata(journal::path(root)).is_ok_and(|metadata| metadata.len() > 0);
    let whole = if shards.is_empty() || merged || root.join("campaign.json").is_file() {
        Some(Identity::read(root)?)
    } else {
        None
    };
    // A shard that was not started again since the campaign grew lacks points that its own folder does not know of.
    let known = || whole.iter().chain(shards.iter().map(|(_, identity)| identity));
    let grown = |one: &Identity| {
        let same = known().filter(|other| other.is_same_except_points(one));
        same.map(|other| other.points).max().unwrap_or(one.points)
    };
    let listed = shards.iter().map(|(path, identity)| (path.as_path(), identity));
    let own = whole.iter().filter(|_| shards.is_empty() || merged);
    own.map(|identity| (root, identity))
        .chain(listed)
        .map(|(path, identity)| Part::read(path, identity.clone(), grown(identity)))
        .collect()
}

/// The number of points of the campaign that belong to none of the shards `parts`.
pub fn unassigned_points(parts: &[Part]) -> usize {
    let points = parts.iter().map(|part| part.points).max().unwrap_or(0);
    let mut there = vec![false; points];
    for part in parts {
        let (first, step) = part.identity.shard.map_or((0, 1), |shard| (shard.number - 1, shard.of));
        there
            .iter_mut()
            .skip(first)
            .step_by(step)
            .for_each(|there| *there = true);
    }
    there.iter().filter(|there| !**there).count()
}
