//! Definition of a campaign: its scenario, its points, and the labels of the points.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::column::Column;
use super::plan::{Plan, is_seed_alone};
use super::source::Source;
use crate::scenario::{Changes, ScenarioError, ScenarioSpec};

/// The command that creates a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CampaignKind {
    /// `sweep`
    Sweep,
    /// `faults`
    Faults,
}

/// Many runs of one scenario.
#[derive(Debug)]
pub struct Campaign {
    /// The command that creates it.
    pub kind: CampaignKind,
    /// The scenario file.
    pub scenario: PathBuf,
    /// Changes that all points share.
    pub overrides: Changes,
    /// The labels of the points, as columns of the table.
    pub columns: Vec<Column>,
    /// The changes of each point.
    pub points: Vec<Vec<String>>,
    /// Points, from 0, that do not exist, with the reason.
    pub refused: Vec<(usize, String)>,
    /// The campaign file that declares the points, where one does.
    pub source: Option<Source>,
    /// Whether the table has the digest of each point's tape, which requires every sample to be computed and hashed.
    pub digests: bool,
}

impl Campaign {
    /// All points of a plan.
    pub fn of_plan(kind: CampaignKind, scenario: PathBuf, overrides: Changes, plan: &Plan) -> Campaign {
        Campaign::of_columns(kind, scenario, overrides, plan.unrolled())
    }

    /// Points with these columns and changes, or the reason why a point does not exist.
    pub(super) fn of_columns(
        kind: CampaignKind,
        scenario: PathBuf,
        overrides: Changes,
        (columns, settings): (Vec<Column>, Vec<Result<Vec<String>, String>>),
    ) -> Campaign {
        let mut refused = Vec::new();
        let points = settings.into_iter().enumerate().map(|(k, settings)| {
            settings.unwrap_or_else(|reason| {
                refused.push((k, reason));
                Vec::new()
            })
        });
        Campaign {
            points: points.collect(),
            kind,
            scenario,
            overrides,
            columns,
            refused,
            source: None,
            digests: false,
        }
    }

    /// Whether the points are a sample: each is one draw of everything that varies, so that confidence intervals hold.
    pub fn is_sample(&self) -> bool {
        match &self.source {
            Some(source) => source.sample,
            None => self.kind == CampaignKind::Sweep && is_seed_alone(&self.columns),
        }
    }

    /// The scenario of point `at` (from 0).
    ///
    /// # Errors
    /// The mistake in the form of the scenario or of a change of it.
    pub fn spec_of(&self, at: usize) -> Result<ScenarioSpec, ScenarioError> {
        let mut spec = ScenarioSpec::changed(&self.scenario, &self.overrides)?;
        spec.vary(&self.points[at])?;
        Ok(spec)
    }

    /// The labels of point `at` (from 0), by column.
    pub fn values(&self, at: usize) -> serde_json::Map<String, serde_json::Value> {
        let values = self.columns.iter();
        values.map(|column| (column.name.clone(), column.json(at))).collect()
    }

    /// The campaign with only its first `count` points.
    #[must_use]
    pub fn first(&self, count: usize) -> Campaign {
        Campaign {
            kind: self.kind,
            scenario: self.scenario.clone(),
            overrides: self.overrides.clone(),
            columns: self.columns.iter().map(|column| column.first(count)).collect(),
            points: self.points.iter().take(count).cloned().collect(),
            refused: self.refused.iter().filter(|(at, _)| *at < count).cloned().collect(),
            source: self.source.clone(),
            digests: self.digests,
        }
    }
}
