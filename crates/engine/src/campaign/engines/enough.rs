//! A campaign on an engine that ends when enough is known: it is given in parts, each twice as large as what there was.

use std::sync::Arc;

use super::submit::{Cluster, Step, place, submit};
use crate::Catalogue;
use crate::campaign::identity::Identity;
use crate::campaign::merge::merge;
use crate::campaign::until::Watch;
use crate::campaign::{Campaign, CampaignError, Finished, Options};
use crate::scenario::Scenario;

/// So many points are given before the first look. A share that is met or not met is not known within some percent with fewer.
const BEGIN: usize = 128;

/// What was done.
#[derive(Debug)]
pub enum Progressed {
    /// Shards of these first points were given to the engine, or are with it.
    Given(Step),
    /// Enough is known, or there are no more points: the campaign with those that count, merged.
    Enough(Campaign, Box<Finished>),
}

/// Gives the first points of `campaign` to the engine; where they are complete and `watch` does not know enough, twice as many. The end is
/// the point at which one machine would have ended: where parts end decides only how many points run in vain.
///
/// # Errors
/// As [`submit`] and [`merge`]; where the points of a smaller campaign are not the first points of a larger one.
pub fn submit_until(
    catalogue: &Arc<Catalogue>,
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
    cluster: &Cluster,
    watch: &Watch,
) -> Result<Progressed, CampaignError> {
    let all = campaign.points.len();
    if !options.grows {
        return cluster.engine.refuse(
            "--until gives a campaign in parts, and the points of this one are not those of a smaller one: leave --until out, or let seeds or \
             the design random or sobol make the points",
        );
    }
    let root = place(campaign, &Identity::of(campaign, scenario)?, options)?;
    // A folder that has more points than are wanted is refused where it is taken.
    let known = Identity::read(&root).map_or(0, |known| known.points);
    let mut count = known.max(BEGIN).min(all);
    loop {
        let part = campaign.first(count);
        let step = submit(catalogue, &part, scenario, options, cluster)?;
        let Step::Complete { root, shards } = &step else {
            return Ok(Progressed::Given(step));
        };
        let (part, mut finished) = merge(root, shards)?;
        let end = watch.clone().look(&finished.results);
        if end.is_some() || count == all {
            finished.results.truncate(end.unwrap_or(count));
            return Ok(Progressed::Enough(part, Box::new(finished)));
        }
        count = (2 * count).min(all);
    }
}
