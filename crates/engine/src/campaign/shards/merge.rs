//! Merging of the folders of a campaign's shards into the folder of the whole.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::campaign::folder::campaign_folder::{Folder, holder};
use crate::campaign::folder::identity::Identity;
use crate::campaign::folder::journal::{self, JournalEntry};
use crate::campaign::folder::table::figure_of;
use crate::campaign::workers::point::Result as PointResult;
use crate::campaign::workers::pool::Finished;
use crate::campaign::{Campaign, CampaignError, Figures, Number};

/// Number of points that an error names where points are missing.
const LISTED_MAX: usize = 5;

/// A campaign that was merged from its shards.
#[derive(Debug)]
pub struct Merged {
    /// The campaign.
    pub campaign: Campaign,
    /// Its results.
    pub finished: Finished,
    /// The figure of merit that was asked for.
    pub figure: Option<Number>,
    /// What was run twice.
    pub audits: AuditCoverage,
}

/// The points of a merged campaign that were run twice, with the same result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditCoverage {
    /// The number of second runs that were compared.
    pub compared: usize,
    /// Where other folders have second runs: the folders that have none.
    pub without: Vec<PathBuf>,
}

fn refuse<T>(reason: impl Into<String>) -> Result<T, CampaignError> {
    Err(CampaignError::Merge(reason.into()))
}

/// Creates the folder `out` from the folders `shards`: the campaign with all results, as one machine would have produced
/// it. `figure` is the name of a figure of merit that its points must have.
///
/// # Errors
/// When the folders are not of one campaign, when a point is in two of them or in none, when a process holds one of them,
/// and when a point that was run twice has two results.
pub fn merge(out: &Path, shards: &[PathBuf], figure: Option<&str>) -> Result<Merged, CampaignError> {
    let started = Instant::now();
    let mut folders: Vec<(&PathBuf, Identity)> = Vec::new();
    for root in shards {
        folders.push((root, Identity::read(root)?));
    }
    let [(first, identity), others @ ..] = &folders[..] else {
        return refuse("no shard is named: give the folders of all shards");
    };
    if identity.source.as_ref().is_some_and(|source| source.rare) {
        return refuse(format!(
            "{} is of a campaign with the design subset, whose points depend on each other: it runs on one machine, and there is nothing \
             to merge",
            first.display()
        ));
    }
    for (root, other) in others {
        if other.digest != identity.digest {
            return refuse(format!(
                "{} and {} are not of one campaign: {}; run one of them again",
                first.display(),
                root.display(),
                identity.difference(other)
            ));
        }
    }
    if let Some((root, _)) = folders.iter().find(|(root, _)| holder(root).is_some()) {
        return refuse(format!("{} is being worked in: wait for its end", root.display()));
    }
    let mut campaign = Campaign::without_points(identity);
    let mut merged = MergedResults {
        results: vec![None; identity.points],
        sources: vec![(0, String::new()); identity.points],
        audits: BTreeMap::new(),
    };
    for (number, (root, identity)) in folders.iter().enumerate() {
        merged.read_journal(number, root, identity, &folders)?;
        campaign.read_points(root, identity)?;
    }
    merged.check_complete(&folders)?;
    identity
        .check_points_digest("points.jsonl of the shards", &campaign)
        .or_else(refuse)?;
    merged.check_audits(&folders)?;
    let figure = match figure {
        Some(name) => Some(figure_of(name, &merged.figures())?),
        None => None,
    };
    let audits = merged.audit_coverage(&folders);
    let whole_identity = Identity {
        shard: None,
        audit: 0.0,
        until: None,
        ..identity.clone()
    };
    let (folder, known) = Folder::lock_at(out, &campaign, &whole_identity)?;
    for (at, result) in merged.results.iter().enumerate() {
        if known.results[at].is_none()
            && let Some(result) = result
        {
            folder.append_foreign_result(&campaign, at + 1, &merged.sources[at].1, result)?;
        }
    }
    let finished = Finished {
        folder,
        identity: whole_identity,
        resumed: 0,
        results: merged.results,
        interrupted: false,
        wall_s: started.elapsed().as_secs_f64(),
    };
    Ok(Merged {
        campaign,
        finished,
        figure,
        audits,
    })
}

/// The results of all shards.
struct MergedResults {
    results: Vec<Option<PointResult>>,
    /// For each point, the number of its folder and the machine.
    sources: Vec<(usize, String)>,
    /// Second runs by point and number of the folder.
    audits: BTreeMap<(usize, usize), JournalEntry>,
}

type Folders<'a> = [(&'a PathBuf, Identity)];

impl MergedResults {
    /// Reads the journal of folder number `number`.
    fn read_journal(
        &mut self,
        number: usize,
        root: &Path,
        identity: &Identity,
        folders: &Folders,
    ) -> Result<(), CampaignError> {
        let (mut duplicate, points) = (None::<(usize, usize)>, self.results.len());
        journal::for_each_entry(&journal::path(root), |entry| {
            let Some(at) = entry.point.checked_sub(1).filter(|at| *at < points) else {
                return;
            };
            if entry.audit {
                // A repeated second run replaces the earlier one.
                self.audits.insert((entry.point, number), entry);
            } else if identity.owns(at) {
                if self.results[at].is_some() && self.sources[at].0 != number {
                    let this = (entry.point, self.sources[at].0);
                    // The lowest number, regardless of the order of the journal.
                    duplicate = Some(duplicate.map_or(this, |known| known.min(this)));
                }
                self.results[at] = Some(entry.result);
                self.sources[at] = (number, entry.node);
            }
        })?;
        match duplicate {
            None => Ok(()),
            Some((point, other)) => refuse(format!(
                "point {point} is in {} and in {}: give each shard once",
                folders[other].0.display(),
                root.display()
            )),
        }
    }

    /// Checks that every point has a result, and every second run of each shard.
    fn check_complete(&self, folders: &Folders) -> Result<(), CampaignError> {
        let missing = |at: &usize| self.results[*at].is_none();
        let all: Vec<usize> = (0..self.results.len()).filter(missing).collect();
        if !all.is_empty() {
            let mut text = format!("{} of {} points are missing: ", all.len(), self.results.len());
            let mut parts = Vec::new();
            for (root, identity) in folders {
                let own = all.iter().filter(|at| identity.owns(**at)).count();
                if own > 0 {
                    parts.push(format!(
                        "{own} of {} (start it again, it goes on from there)",
                        root.display()
                    ));
                }
            }
            let owned = |at: &&usize| folders.iter().any(|(_, identity)| identity.owns(**at));
            let unassigned: Vec<&usize> = all.iter().filter(|at| !owned(at)).collect();
            if !unassigned.is_empty() {
                let named = unassigned.iter().take(LISTED_MAX).map(|at| (**at + 1).to_string());
                let more = if unassigned.len() > LISTED_MAX { ", …" } else { "" };
                let named: Vec<String> = named.collect();
                parts.push(format!(
                    "{} in no folder that was given, such as point {}{more} (give the folders of all shards)",
                    unassigned.len(),
                    named.join(", ")
                ));
            }
            text += &parts.join("; ");
            return refuse(text);
        }
        for (number, (root, identity)) in folders.iter().enumerate() {
            let wanted = |at: &usize| identity.audits(*at);
            let there = |at: &usize| self.audits.contains_key(&(at + 1, number));
            if let Some(at) = (0..self.results.len()).filter(wanted).find(|at| !there(at)) {
                return refuse(format!(
                    "{} has not yet run point {} a second time: start it again, it goes on from there",
                    root.display(),
                    at + 1
                ));
            }
        }
        Ok(())
    }

    /// The figures of merit of the points.
    fn figures(&self) -> Vec<Number> {
        let mut all = self.results.iter().flatten();
        let first = all.find_map(|result| result.figures.as_ref());
        first.map_or(Vec::new(), Figures::ordered)
    }

    /// What was run twice.
    fn audit_coverage(&self, folders: &Folders) -> AuditCoverage {
        let without = folders.iter().filter(|(_, identity)| identity.audit == 0.0);
        AuditCoverage {
            compared: self.audits.len(),
            without: match self.audits.len() {
                0 => Vec::new(),
                _ => without.map(|(root, _)| (*root).clone()).collect(),
            },
        }
    }

    /// Checks that second runs gave the same bits.
    fn check_audits(&self, folders: &Folders) -> Result<(), CampaignError> {
        let name = |(number, node): (usize, &str)| format!("{} on node `{node}`", folders[number].0.display());
        let (mut differences, mut nodes) = (Vec::new(), BTreeMap::<String, usize>::new());
        for ((_, number), entry) in &self.audits {
            let at = entry.point - 1;
            let Some(result) = self.results[at].as_ref().filter(|result| **result != entry.result) else {
                continue;
            };
            let outcomes = || (result.outcome.name().into(), entry.result.outcome.name().into());
            let (first, second) = result.difference(&entry.result).unwrap_or_else(outcomes);
            let (number_of_first, node_of_first) = &self.sources[at];
            differences.push(format!(
                "point {}: {first} in {}, {second} in {}",
                entry.point,
                name((*number_of_first, node_of_first)),
                name((*number, &entry.node)),
            ));
            for node in std::collections::BTreeSet::from([node_of_first, &entry.node]) {
                *nodes.entry(node.clone()).or_default() += 1;
            }
        }
        if differences.is_empty() {
            return Ok(());
        }
        let most = nodes.values().max().copied().unwrap_or(0);
        let suspects: Vec<String> = nodes
            .iter()
            .filter(|(_, count)| **count == most)
            .map(|(node, count)| format!("`{node}` ({count})"))
            .collect();
        let count = differences.len();
        let more = if count > LISTED_MAX { "\n  …" } else { "" };
        differences.truncate(LISTED_MAX);
        refuse(format!(
            "{count} of {} points that were run twice have other bits the second time; most often on node {}:\n  {}{more}\n\
             run one of them a third time elsewhere (`run --point FOLDER:POINT`), and the shards of the node that is wrong again in new folders",
            self.audits.len(),
            suspects.join(" or "),
            differences.join("\n  "),
        ))
    }
}
