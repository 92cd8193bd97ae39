//! A campaign on an engine, from the first shard to the table. One that ends when enough is known is given in parts, each twice as large as
//! what there was.

use std::sync::Arc;

use super::submit::{Cluster, Gave, Underway, give, place};
use crate::Catalogue;
use crate::campaign::identity::Identity;
use crate::campaign::merge::merge;
use crate::campaign::{Campaign, CampaignError, Finished, Options};
use crate::scenario::Scenario;

/// So many points are given before the first look. A share that is met or not met is not known within some percent with fewer.
const BEGIN: usize = 128;

/// How far the campaign is.
#[derive(Debug)]
pub enum Step {
    /// Shards were given to the engine, or are with it.
    Given(Underway),
    /// All is there, or enough: the campaign with the points that count, merged.
    Complete(Box<Campaign>, Box<Finished>),
}

/// Gives those shards of `campaign` to the engine that are missing and not with it, and merges them when all are complete. With
/// [`Options::until`] the first points are given, and twice as many where those are complete and not enough; the end is the point at which
/// one machine would have ended, and where parts end decides only how many points run in vain.
///
/// # Errors
/// When the folder belongs to something else, the engine refuses, or shards do not make a whole. What the engine has taken by then is known to
/// the next call. With [`Options::until`] also where the points of a smaller campaign are not the first points of a larger one.
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
        Some(_) => begin(campaign, scenario, options, cluster)?,
    };
    loop {
        let part = campaign.first(count);
        let (root, shards) = match give(catalogue, &part, scenario, options, cluster)? {
            Gave::Underway(underway) => return Ok(Step::Given(underway)),
            Gave::Complete { root, shards } => (root, shards),
        };
        let (part, mut finished) = merge(&root, &shards)?;
        let watch = options.until.clone();
        let end = watch.and_then(|mut watch| watch.look(&finished.results));
        if end.is_some() || count == all {
            finished.results.truncate(end.unwrap_or(count));
            return Ok(Step::Complete(Box::new(part), Box::new(finished)));
        }
        count = (2 * count).min(all);
    }
}

/// How many points are given at first: those that the folder is of already, or a few.
fn begin(
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
    let root = place(campaign, &Identity::of(campaign, scenario)?, options)?;
    // A folder that has more points than are wanted is refused where it is taken.
    let known = Identity::read(&root).map_or(0, |known| known.points);
    Ok(known.max(BEGIN).min(campaign.points.len()))
}
