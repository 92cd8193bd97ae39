//! The points in a campaign's folder: `points.jsonl`.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::any_path::AnyPath;
use super::identity::{Identity, io_error};
use crate::campaign::{Campaign, CampaignError};

/// A line of `points.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointRow {
    /// From 1.
    pub point: usize,
    /// Its changes.
    pub changes: Vec<String>,
    /// Its texts in the columns.
    texts: Vec<String>,
    /// Its numbers in those columns that have numbers; none where JSON cannot represent the number.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    numbers: Vec<Option<f64>>,
    /// The reason why the point does not exist.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

/// The name of the file in a campaign's folder.
const FILE: &str = "points.jsonl";

/// How a damaged file is replaced.
const REMEDY: &str = "give the command that started the campaign again with this folder, which writes the file anew, or copy the folder again";

fn refusal(root: &Path, reason: impl Into<String>) -> CampaignError {
    CampaignError::Folder {
        path: root.join(FILE),
        reason: reason.into(),
    }
}

impl Identity {
    /// The content of `points.jsonl`: the points that belong to the folder.
    fn rows(&self, campaign: &Campaign) -> serde_json::Result<Vec<u8>> {
        let mut lines = Vec::new();
        for at in 0..campaign.points.len() {
            if self.owns(at) || self.audits(at) {
                serde_json::to_writer(&mut lines, &campaign.row(at))?;
                lines.push(b'\n');
            }
        }
        Ok(lines)
    }

    /// Writes the points that belong to the folder `root` and its identity.
    pub(crate) fn write(&self, root: &Path, campaign: &Campaign) -> Result<(), CampaignError> {
        let path = root.join(FILE);
        let rows = self
            .rows(campaign)
            .map_err(|error| io_error(&path, "write the file")(error.into()))?;
        tape::write_atomic(&path, rows).map_err(io_error(&path, "write the file"))?;
        // The points first: a folder with this file is guaranteed to have them.
        let path = root.join("campaign.json");
        let text =
            serde_json::to_string_pretty(self).map_err(|error| io_error(&path, "write the file")(error.into()))? + "\n";
        tape::write_atomic(&path, text).map_err(io_error(&path, "write the file"))
    }

    /// Whether the folder `root` has exactly these points.
    pub(crate) fn has_rows(&self, root: &Path, campaign: &Campaign) -> bool {
        let bytes = fs::read(root.join(FILE));
        bytes.is_ok_and(|bytes| self.rows(campaign).is_ok_and(|rows| rows == bytes))
    }

    /// Checks that the points in the folder `root`, which fill `campaign`, are all there: a point without its row would
    /// run without its changes.
    fn check_all_present(&self, root: &Path, present: &[bool]) -> Result<(), CampaignError> {
        let belongs = |at: &usize| self.owns(*at) || self.audits(*at);
        let missing = (0..self.points).filter(belongs).filter(|at| !present[*at]);
        let missing: Vec<usize> = missing.map(|at| at + 1).collect();
        let Some(first) = missing.first() else { return Ok(()) };
        let more = match missing.len() {
            1 => String::new(),
            count => format!(", and those of {} others", count - 1),
        };
        Err(refusal(
            root,
            format!("the row of point {first} is missing{more}: {REMEDY}"),
        ))
    }

    /// Checks that `campaign` has the points that the digest in `campaign.json` is of; they were read from `places`.
    pub(crate) fn check_points_digest(&self, places: &str, campaign: &Campaign) -> Result<(), String> {
        if self.digest_of(campaign, self.points) == self.digest {
            return Ok(());
        }
        Err(format!(
            "the points in {places} are not those that the campaign was started with (their digest is not the one in campaign.json, so a \
             row or that file was changed): {REMEDY}"
        ))
    }
}

impl Campaign {
    /// The row of point `at` (from 0) in its folder.
    fn row(&self, at: usize) -> PointRow {
        PointRow {
            point: at + 1,
            changes: self.points[at].clone(),
            texts: self.columns.iter().map(|column| column.texts[at].clone()).collect(),
            numbers: self
                .columns
                .iter()
                .filter_map(|column| Some(Some(column.numbers.as_ref()?[at]).filter(|number| number.is_finite())))
                .collect(),
            refused: self.refused_at(at).map(str::to_owned),
        }
    }

    /// Reads the points of the folder `root` with the identity `identity` into their places.
    ///
    /// # Errors
    /// When the file is damaged, or lacks a point of the folder.
    pub(crate) fn read_points(&mut self, root: &Path, identity: &Identity) -> Result<(), CampaignError> {
        let mut present = vec![false; self.points.len()];
        let with_numbers = self.columns.iter().filter(|column| column.numbers.is_some()).count();
        let widths = (self.columns.len(), with_numbers);
        for_each_row(root, |row| {
            if (row.texts.len(), row.numbers.len()) != widths {
                return Err("has other columns than campaign.json names".to_owned());
            }
            // A folder whose growth was interrupted has rows beyond its points.
            let Some(at) = row.point.checked_sub(1).filter(|at| *at < self.points.len()) else {
                return Ok(());
            };
            present[at] = true;
            let mut numbers = row.numbers.into_iter();
            for (column, text) in self.columns.iter_mut().zip(row.texts) {
                if let Some(whole) = &mut column.whole {
                    whole[at] = text.parse().unwrap_or_default();
                }
                if let Some((own, number)) = column.numbers.as_mut().and_then(|own| Some((own, numbers.next()?))) {
                    let digits = || text.split(' ').next()?.parse().ok();
                    own[at] = number.or_else(digits).unwrap_or(f64::NAN);
                }
                column.texts[at] = text;
            }
            self.points[at] = row.changes;
            self.refused.extend(row.refused.map(|reason| (at, reason)));
            Ok(())
        })?;
        self.refused.sort();
        self.refused.dedup();
        identity.check_all_present(root, &present)
    }

    /// The campaign whose folder is `root`, with the points that the folder is for; and the identity of the folder.
    ///
    /// # Errors
    /// When it is not a campaign's folder, or does not have the points that it was made for.
    pub fn of_folder(root: &Path) -> Result<(Campaign, Identity), CampaignError> {
        let identity = Identity::read(root)?;
        let mut campaign = Campaign::without_points(&identity);
        // In a bundle the path is relative to the bundle; elsewhere it is absolute.
        campaign.scenario = root.join(&campaign.scenario);
        if let Some(source) = &mut campaign.source {
            source.file = AnyPath(root.join(&source.file.0));
        }
        campaign.read_points(root, &identity)?;
        // A shard has only its own points, and the digest is of all of them: `merge` compares it.
        if identity.shard.is_none() {
            let same = identity.check_points_digest("it", &campaign);
            same.map_err(|reason| refusal(root, reason))?;
        }
        Ok((campaign, identity))
    }
}

/// Passes on the rows of the folder `root`; `take` returns what is wrong with a row.
fn for_each_row(root: &Path, mut visit: impl FnMut(PointRow) -> Result<(), String>) -> Result<(), CampaignError> {
    let path = root.join(FILE);
    let file = fs::File::open(&path).map_err(|error| refusal(root, format!("cannot be read ({error}): {REMEDY}")))?;
    for (number, line) in BufReader::new(file).split(b'\n').enumerate() {
        let line = line.map_err(io_error(&path, "read the file"))?;
        let row = serde_json::from_slice(&line).map_err(|error| format!("is no row of a point ({error})"));
        row.and_then(&mut visit)
            .map_err(|wrong| refusal(root, format!("line {} {wrong}: {REMEDY}", number + 1)))?;
    }
    Ok(())
}
