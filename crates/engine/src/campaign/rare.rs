//! Rare-event campaigns: the probability that a criterion is not met, estimated by subset simulation.
//!
//! The points come in batches. Each batch follows from the results before it, so an incomplete folder is continued like
//! that of any other campaign: the batches are recomputed from its journal.

use std::path::Path;

use sampling::subset::{Candidate, Estimate, Subset};
use serde_json::{Value, json};

use super::declared::Declared;
use super::folder::campaign_folder::Folder;
use super::folder::identity::Identity;
use super::folder::journal;
use super::folder::keep::Keep;
use super::options::Options;
use super::plan::{Plan, columns_of};
use super::workers::point::{Outcome, Result as PointResult};
use super::workers::pool::{Finished, run_with_identity};
use super::{Campaign, CampaignError, POINTS_MAX};
use crate::assessment::Criterion;
use crate::scenario::Scenario;

/// Chains with a lower acceptance rate than this do not move.
const ACCEPTANCE_MIN: f64 = 0.05;

/// The search for a rare event.
#[derive(Debug)]
pub struct Rare {
    subset: Subset,
    /// The criterion; the only one unless given.
    criterion: Option<String>,
}

/// A rare-event campaign that has ended, or was stopped.
#[derive(Debug)]
pub struct RareEventResult {
    /// All of its points.
    pub campaign: Campaign,
    /// The results of the points.
    pub finished: Finished,
    /// How many of them are a plain random sample: those of the first level.
    pub sample: usize,
    /// The probability that the criterion is not met, up to the last complete level.
    pub estimate: Estimate,
    /// The criterion, without a value.
    pub criterion: Criterion,
    /// The dispersions that the coordinates of the estimate's centre belong to.
    pub names: Vec<String>,
}

impl Rare {
    /// Creates the search for the event that `criterion` is not met.
    pub(super) fn new(subset: Subset, criterion: Option<String>) -> Rare {
        Rare { subset, criterion }
    }

    /// The criterion among those of the runs; `measured` returns whether they have a measure of a name.
    ///
    /// # Errors
    /// When there is none of that name, or several and none is named: the reason.
    pub(super) fn criterion(&self, known: &[Criterion], measured: impl Fn(&str) -> bool) -> Result<Criterion, String> {
        let names: Vec<String> = known.iter().map(|one| format!("`{}`", one.name)).collect();
        let there = match &names[..] {
            [] => "there is none that could be missed: give a measure a limit".to_owned(),
            names => format!("there is {}", names.join(", ")),
        };
        match (&self.criterion, known) {
            (None, []) => Err("the scenario has no criterion that could be missed: give a measure a limit".to_owned()),
            (None, [one]) => Ok(one.clone()),
            (None, _) => Err(format!(
                "the scenario has several criteria: write which one is to be missed, criterion = \"…\" in [subset], one of {}",
                names.join(", ")
            )),
            (Some(name), _) => known.iter().find(|one| one.name == *name).cloned().ok_or_else(|| {
                if measured(name) {
                    format!(
                        "the measure `{name}` is no criterion, because it has no limit: give [measures.{name}] `at-most`, `at-least` or \
                         `within`; among the criteria {there}"
                    )
                } else {
                    format!("there is no criterion `{name}`: {there}")
                }
            }),
        }
    }

    /// Runs level after level. `first` is the campaign of the first level, which `plan` declares.
    ///
    /// # Errors
    /// As [`super::run`], and when a point crashes, because later points depend on its result.
    pub fn run(
        self,
        first: Campaign,
        plan: &Plan,
        criterion: Criterion,
        scenario: &Scenario,
        options: &Options,
    ) -> Result<RareEventResult, CampaignError> {
        let Plan::Declared(declared) = plan else {
            return Err(CampaignError::Rare("a list has no levels".into()));
        };
        let root = Folder::path_of(&first, &Identity::of(&first, scenario)?, options);
        let known = journaled_results(&root)?;
        let mut levels = LevelRunner {
            sample: first.points.len(),
            subset: self.subset,
            declared,
            criterion: &criterion,
            scenario,
            options: Options {
                out: Some(root),
                // The worst points are known only at the end.
                keep: options
                    .keep
                    .iter()
                    .filter(|keep| **keep == Keep::All)
                    .cloned()
                    .collect(),
                ..options.clone()
            },
            campaign: first,
            points: Vec::new(),
            known,
            finished: None,
        };
        levels.run()?;
        if levels.finished.is_none() {
            // All results were in the journal: nothing is run, and the folder is opened.
            levels.run_missing_points()?;
        }
        let LevelRunner {
            sample,
            subset,
            campaign,
            finished: Some(mut finished),
            ..
        } = levels
        else {
            unreachable!("work leaves what has finished, or an error");
        };
        if !finished.interrupted {
            finished.keep(&campaign, scenario, options)?;
        }
        Ok(RareEventResult {
            sample,
            estimate: subset.estimate(),
            criterion,
            names: declared.names(),
            campaign,
            finished,
        })
    }
}

/// The results in the journal of the folder `root`, by point. A point that crashed is run again.
fn journaled_results(root: &Path) -> Result<Vec<Option<PointResult>>, CampaignError> {
    let mut known = Vec::new();
    journal::for_each_entry(&journal::path(root), |entry| {
        let Some(at) = entry.point.checked_sub(1) else { return };
        if at < POINTS_MAX && !entry.audit {
            known.resize(known.len().max(at + 1), None);
            known[at] = Some(entry.result).filter(|result| result.outcome != Outcome::Crashed);
        }
    })?;
    Ok(known)
}

/// A campaign that grows by one batch at a time.
struct LevelRunner<'a> {
    subset: Subset,
    declared: &'a Declared,
    criterion: &'a Criterion,
    scenario: &'a Scenario,
    options: Options,
    sample: usize,
    /// All points so far.
    campaign: Campaign,
    points: Vec<Candidate>,
    known: Vec<Option<PointResult>>,
    finished: Option<Finished>,
}

impl LevelRunner<'_> {
    fn run(&mut self) -> Result<(), CampaignError> {
        while let Some(batch) = self.subset.batch() {
            let wanted: Vec<usize> = batch.iter().map(|one| one.number).collect();
            self.points.extend_from_slice(batch);
            if self.scores(&wanted).is_none() {
                self.run_missing_points()?;
            }
            match self.scores(&wanted) {
                Some(scores) => self.subset.submit_scores(&scores),
                // The user requested an end.
                None => return Ok(()),
            }
        }
        Ok(())
    }

    /// The scores of these points, if all are known.
    fn scores(&self, wanted: &[usize]) -> Option<Vec<f64>> {
        let results = wanted.iter().map(|at| self.known.get(*at)?.as_ref());
        results
            .map(|result| Some(score(result?, &self.criterion.name)))
            .collect()
    }

    /// Extends the campaign to all points so far.
    fn extend_campaign(&mut self) {
        let points = self.points.iter().map(|one| self.declared.candidate(one));
        let before = &self.campaign;
        self.campaign = Campaign {
            source: before.source.clone(),
            digests: before.digests,
            ..Campaign::of_columns(
                before.kind,
                before.scenario.clone(),
                before.overrides.clone(),
                columns_of(self.declared.heads(), points),
            )
        };
    }

    /// Runs the points that have no results yet.
    fn run_missing_points(&mut self) -> Result<(), CampaignError> {
        if self.points.len() > POINTS_MAX {
            let reason = format!("the levels take more than {POINTS_MAX} points: draw less");
            return Err(CampaignError::Rare(reason));
        }
        self.extend_campaign();
        // The folder is unlocked before it is locked again.
        let before = self.finished.take().map(|before| (before.resumed, before.wall_s));
        let identity = Identity::of(&self.campaign, self.scenario)?;
        let resumed = before.map(|(resumed, _)| resumed);
        let mut ended = run_with_identity(&self.campaign, self.scenario, identity, &self.options, resumed)?;
        ended.wall_s += before.map_or(0.0, |(_, wall_s)| wall_s);
        self.known.clone_from(&ended.results);
        let mut all = self.known.iter().zip(1..);
        let crashed = all.find_map(|(result, number)| {
            let result = result.as_ref()?;
            (result.outcome == Outcome::Crashed).then(|| (number, result.reason.clone().unwrap_or_default()))
        });
        match crashed.filter(|_| !ended.interrupted) {
            Some((number, reason)) => Err(CampaignError::Rare(format!(
                "point {number} crashed, and what comes next depends on it: {reason}; the same command runs it again"
            ))),
            None => {
                self.finished = Some(ended);
                Ok(())
            }
        }
    }
}

/// The amount by which a point misses the criterion: above zero it is not met. Infinity where the figure was not measured
/// or the run failed; NaN where the point does not exist.
fn score(result: &PointResult, criterion: &str) -> f64 {
    if result.outcome == Outcome::Refused {
        return f64::NAN;
    }
    let criteria = result.figures.as_ref().map_or(&[][..], |figures| &figures.criteria);
    let Some(one) = criteria.iter().find(|one| one.name == criterion) else {
        return f64::INFINITY;
    };
    let Some(value) = one.value.filter(|value| !value.is_nan() && result.outcome.ran()) else {
        return f64::INFINITY;
    };
    let above = one.limit.map(|most| value - most);
    let below = one.at_least.map(|least| least - value);
    // A criterion that is only met or not has no distance.
    let plain = if one.met { -1.0 } else { 1.0 };
    above.into_iter().chain(below).reduce(f64::max).unwrap_or(plain)
}

impl RareEventResult {
    /// The figure with this score: thresholds in units of the figure. `None` where the criterion has limits on both sides,
    /// or none.
    pub fn figure(&self, score: f64) -> Option<f64> {
        match (self.criterion.limit, self.criterion.at_least) {
            (Some(most), None) => Some(most + score),
            (None, Some(least)) => Some(least - score),
            _ => None,
        }
    }

    /// All results about the event, for its file and for the page.
    pub fn json(&self) -> Value {
        let estimate = &self.estimate;
        let levels = estimate.levels.iter().map(|level| {
            json!({
                "threshold": self.figure(level.threshold),
                "states": level.states,
                "share": level.share,
                "variation": level.variation,
                "acceptance": level.acceptance,
            })
        });
        let curve = thinned(estimate.exceedance());
        let curve = curve
            .into_iter()
            .filter_map(|(score, part)| Some((self.figure(score)?, part)));
        json!({
            "criterion": self.criterion.name,
            "limits": self.criterion.limits(),
            "unit": self.criterion.unit,
            "probability": estimate.probability,
            "interval": estimate.interval,
            "variation": finite(estimate.variation),
            "ancestors": estimate.ancestors,
            "points": estimate.points,
            "equivalent": finite(estimate.equivalent),
            "stuck": estimate.stuck,
            "complete": !self.finished.interrupted,
            "levels": levels.collect::<Vec<_>>(),
            "exceedance": curve.collect::<Vec<_>>(),
            "centre": self.names.iter().zip(&estimate.centre).collect::<Vec<_>>(),
        })
    }

    /// The same as a few lines of text.
    pub fn to_text(&self) -> String {
        let estimate = &self.estimate;
        let name = self.criterion.name.replace('_', " ");
        let [low, high] = estimate.interval;
        let mut lines = vec![if estimate.probability > 0.0 {
            format!(
                "{name} ({}) is missed with a probability of {:.2e}: {low:.1e} to {high:.1e} with 95 % confidence",
                self.criterion.limits(),
                estimate.probability
            )
        } else {
            format!(
                "{name} ({}) was never missed: its probability is below {high:.1e} with 95 % confidence",
                self.criterion.limits()
            )
        }];
        let steps = estimate.levels.last().and_then(|level| level.acceptance);
        if estimate.stuck && steps.is_some_and(|taken| taken < ACCEPTANCE_MIN) {
            lines.push(
                "  the levels stopped rising: hardly any step was accepted; where noise decides, seeds = \"same\" leaves only what is dispersed".to_owned(),
            );
        } else if estimate.stuck {
            lines.push(
                "  the levels stopped rising: the figure takes few different values, so there is no advantage over counting"
                    .to_owned(),
            );
        } else if estimate.probability == 0.0 {
            lines.push("  the last level does not reach it: allow more `levels` in [subset]".to_owned());
        }
        if estimate.equivalent > 2.0 * estimate.points as f64 && estimate.equivalent.is_finite() {
            lines.push(format!(
                "  {} points in {} levels; as many independent ones as say the same: {:.1e}",
                estimate.points,
                estimate.levels.len(),
                estimate.equivalent
            ));
        }
        let mut centre: Vec<(&String, f64)> = self.names.iter().zip(estimate.centre.iter().copied()).collect();
        centre.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let apart: Vec<String> = centre
            .iter()
            .filter(|(_, mean)| mean.abs() >= 1.0)
            .take(5)
            .map(|(name, mean)| format!("{name} {mean:+.1}"))
            .collect();
        if !apart.is_empty() {
            lines.push(format!(
                "  where it is missed (in standard deviations): {}",
                apart.join(", ")
            ));
        }
        lines.join("\n")
    }
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// The points of a curve, thinned out to the number that a chart shows, with both ends.
fn thinned(mut curve: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    const SHOWN: usize = 600;
    curve.retain(|(score, _)| score.is_finite());
    let every = curve.len().div_ceil(SHOWN).max(1);
    let last = curve.last().copied();
    let mut curve: Vec<(f64, f64)> = curve.into_iter().step_by(every).collect();
    curve.extend(last.filter(|last| curve.last() != Some(last)));
    curve
}
