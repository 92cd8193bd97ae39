//! A campaign on an engine, from the first shard to the table. A campaign with a stopping rule is submitted in batches;
//! each doubles the number of points.

use std::sync::Arc;

use super::submit::{Cluster, Submission, SubmittedShards, campaign_root, submit_missing};
use crate::Catalogue;
use crate::campaign::folder::identity::Identity;
use crate::campaign::shards::merge::merge;
use crate::campaign::{Campaign, CampaignError, Finished, Options};
use crate::scenario::Scenario;

/// Number of points submitted before the first check. With fewer points, a share of met points is not known to within a few
/// percent.
const FIRST_BATCH: usize = 128;

/// Progress of the campaign.
#[derive(Debug)]
pub enum Step {
    /// Shards were submitted to the engine, or are still with it.
    Given(SubmittedShards),
    /// All points are complete, or enough: the merged results of the points that count.
    Complete(Box<Finished>),
}

/// Submits to the engine the shards of `campaign` that are missing and not yet with it, and merges them when all are
/// complete. With [`Options::until`] the first points are submitted, and twice as many when those are complete and not
/// enough. The campaign ends at the same point as on one machine; the batch boundaries only decide how many surplus points
/// run.
///
/// # Errors
/// When the folder belongs to something else, the engine refuses, or the shards are incomplete or inconsistent. The next
/// call knows the shards that the engine had accepted before an error. With [`Options::until`] also where the points of a
/// smaller campaign are not the first points of a larger one.
pub fn submit(
    catalogue: &Arc<Catalogue>,
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
    cluster: &Cluster,
) -> Result<Step, CampaignError> {
    let all = campaign.points.len();
    let mut count = match options.until {
        None => all,
        Some(_) => first_batch_size(campaign, scenario, options, cluster)?,
    };
    loop {
        let part = campaign.first(count);
        let mut finished = match submit_missing(catalogue, &part, scenario, options, cluster)? {
            Submission::Submitted(underway) => return Ok(Step::Given(underway)),
            Submission::Complete { root, shards } => merge(&root, &shards, None)?.finished,
            Submission::Merged(finished) => *finished,
        };
        let watch = options.until.clone();
        let end = watch.and_then(|mut watch| watch.evaluate(&finished.results));
        if end.is_some() || count == all {
            finished.results.truncate(end.unwrap_or(count));
            return Ok(Step::Complete(Box::new(finished)));
        }
        count = (2 * count).min(all);
    }
}

/// Number of points of the first batch: those that the folder already is for, or a few.
fn first_batch_size(
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
    cluster: &Cluster,
) -> Result<usize, CampaignError> {
    if !options.grows {
        return cluster.engine.refuse(
            "--until gives a campaign in parts, and the points of this one are not those of a smaller one: leave --until out, or let seeds or \
             the design random or sobol make the points",
        );
    }
    let root = campaign_root(campaign, &Identity::of(campaign, scenario)?, options)?;
    // A folder with more points than are wanted is rejected where it is locked.
    let known = Identity::read(&root).map_or(0, |known| known.points);
    Ok(known.max(FIRST_BATCH).min(campaign.points.len()))
}
