//! A point of an existing campaign, read from its folder to run it again alone.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use super::identity::Identity;
use super::journal;
use crate::campaign::workers::point::Result as PointResult;
use crate::campaign::{Campaign, CampaignError};
use crate::run;
use crate::scenario::{Changes, Scenario, ScenarioError, ScenarioSpec};

/// A point of a campaign.
#[derive(Debug)]
pub struct StoredPoint {
    /// The folder.
    pub root: PathBuf,
    /// From 1.
    pub point: usize,
    /// The scenario file.
    pub file: PathBuf,
    /// Its result, if it was run.
    pub result: Option<PointResult>,
    identity: Identity,
    campaign: Campaign,
}

impl StoredPoint {
    /// Reads the point that `argument` names as `FOLDER:NUMBER`.
    ///
    /// # Errors
    /// When the folder is not a campaign's, or does not have the point.
    pub fn read(argument: &Path) -> Result<StoredPoint, CampaignError> {
        let refuse = |path: &Path, reason: String| CampaignError::Folder {
            path: path.to_owned(),
            reason,
        };
        let bytes = argument.as_os_str().as_bytes();
        let colon = bytes.iter().rposition(|byte| *byte == b':');
        let read = |colon: usize| -> Option<(&Path, usize)> {
            let number = std::str::from_utf8(&bytes[colon + 1..]).ok()?.parse().ok()?;
            Some((Path::new(OsStr::from_bytes(&bytes[..colon])), number))
        };
        let Some((root, point)) = colon.and_then(read) else {
            let reason = "names no point: write FOLDER:NUMBER, such as sweeps/close-0123456789:137".into();
            return Err(refuse(argument, reason));
        };
        let (campaign, identity) = Campaign::of_folder(root)?;
        let owned = |at: &usize| *at < identity.points && identity.owns(*at);
        let Some(at) = point.checked_sub(1).filter(owned) else {
            return Err(refuse(
                root,
                match identity.shard {
                    Some(shard) => format!(
                        "has no point {point}: it has those of shard {shard} of {}",
                        identity.points
                    ),
                    None => format!("has no point {point}: it has 1 to {}", identity.points),
                },
            ));
        };
        if let Some(reason) = campaign.refused_at(at) {
            return Err(refuse(root, format!("point {point} cannot be run: {reason}")));
        }
        let mut result = None;
        journal::for_each_entry(&journal::path(root), |entry| {
            if entry.point == point && !entry.audit {
                result = Some(entry.result);
            }
        })?;
        Ok(StoredPoint {
            root: root.to_owned(),
            point,
            file: campaign.scenario.clone(),
            result,
            identity,
            campaign,
        })
    }

    /// The changes that all points share.
    pub fn common(&self) -> &Changes {
        &self.campaign.overrides
    }

    /// The scenario of the point.
    ///
    /// # Errors
    /// The mistake in the form of the scenario or of a change of it.
    pub fn spec(&self) -> Result<ScenarioSpec, ScenarioError> {
        self.campaign.spec_of(self.point - 1)
    }

    /// Why the point run alone, with the result `outcome`, has another tape than in the campaign, or another figure where
    /// the campaign has no digests of tapes; `None` where it is the same, or did not run to its end. `scenario` is that of
    /// the point without the point's own changes.
    pub fn difference(&self, scenario: &Scenario, outcome: &run::Outcome) -> Option<String> {
        let result = self.result.as_ref().filter(|result| result.outcome.ran())?;
        let own = PointResult::of_run(outcome);
        if own.tape.is_some() && own.tape == result.tape {
            return None;
        }
        let (own, before) = own.difference(result)?;
        let now = Identity::of(&self.campaign, scenario).ok()?;
        let same = (now.program, now.content) == (self.identity.program, self.identity.content);
        let why = if same {
            "nothing that it depends on has changed: one of the two machines cannot be relied upon".to_owned()
        } else {
            self.identity.difference(&now)
        };
        Some(format!(
            "point {} of {} has {own} and had {before} in the campaign: {why}",
            self.point,
            self.root.display(),
        ))
    }
}
