//! Options for running the points of a campaign, common to all campaigns, and the figures of the points.

use std::path::PathBuf;

use clap::Args;
use engine::campaign::{self, Campaign, CampaignError, Figures, Identity, Keep, Options, Shard, Until, Watch};
use engine::run::{self, check, check_with_programs};
use engine::scenario::Scenario;

use crate::catalogue::catalogue;
use crate::{signals, terminal};

/// What the table has besides figures.
#[derive(Debug, Args)]
pub struct DigestArgs {
    /// Add the digest of each point's tape to the table: every output is then computed, whether a figure uses it or not
    #[arg(long)]
    pub digest: bool,
}

impl DigestArgs {
    /// Whether the table has digests: on request, or because the existing folder, which is continued, has them.
    pub fn includes_digests(&self, campaign: &CampaignArgs) -> bool {
        let existing = || Identity::read(campaign.out.as_ref()?).ok();
        self.digest || existing().is_some_and(|known| known.digests)
    }
}

/// What all campaigns take.
#[derive(Debug, Args)]
pub struct CampaignArgs {
    /// The folder for table, chart and journal; by default one that is named after the scenario and the points
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// The number of worker processes; by default one per core
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub workers: Option<u16>,
    /// The number of points that each worker computes at once, in the SIMD lanes of the processor; with 1 it computes one after the other. The
    /// results are the same
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub lanes: Option<u16>,
    /// Keep the run folders with their tapes: of all points, of those that failed, of those that do not meet a criterion, or of the worst ten
    /// (worst:10)
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "all")]
    pub keep: Vec<Keep>,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Print no progress and no summary
    #[arg(long)]
    pub quiet: bool,
}

impl CampaignArgs {
    /// The options of the campaign.
    pub fn options(&self) -> Options {
        Options {
            out: self.out.clone(),
            workers: self.workers.map(usize::from),
            lanes: self.lanes.map(usize::from),
            keep: self.keep.clone(),
            progress: terminal::progress(self.quiet),
            interrupt: signals::interrupt(),
            ..Options::default()
        }
    }
}

/// Which part of the points.
#[derive(Debug, Args)]
pub struct ShardArgs {
    /// Run only every N-th point, from point K on, into a folder of its own; `sweep merge` merges all N folders into one campaign
    #[arg(long, value_name = "K/N")]
    pub shard: Option<Shard>,
    /// Run this proportion of the points, such as 1%, a second time in the next shard: `sweep merge` then names machines whose results differ
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub audit: Option<f64>,
}

/// Parser of a share of the points.
fn parse_share(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is no share: write one above 0 % and up to 100 %, such as 1%");
    let percent: f64 = text
        .trim()
        .strip_suffix('%')
        .and_then(|number| number.trim().parse().ok())
        .ok_or_else(wrong)?;
    (percent > 0.0 && percent <= 100.0)
        .then_some(percent / 100.0)
        .ok_or_else(wrong)
}

impl ShardArgs {
    /// `options` for the shard.
    ///
    /// # Errors
    /// When an option requires the whole campaign.
    pub fn options(&self, options: Options) -> Result<Options, CampaignError> {
        if self.shard.is_some() && options.keep.iter().any(|keep| matches!(keep, Keep::Worst(_))) {
            return Err(CampaignError::Merge(
                "--keep worst: a shard does not know which points are the worst; give it to `sweep merge`".into(),
            ));
        }
        if self.audit.is_some() && self.shard.is_some_and(|shard| shard.of == 1) {
            return Err(audit_without_second_shard("--shard 1/1"));
        }
        Ok(Options {
            shard: self.shard,
            audit: self.audit.unwrap_or(0.0),
            ..options
        })
    }
}

/// The error of an audit without a second shard, as `option` requires.
pub fn audit_without_second_shard(option: &str) -> CampaignError {
    CampaignError::Merge(format!(
        "--audit: with {option} no other shard runs a point a second time: make two shards or more, or leave --audit out"
    ))
}

/// Number of points that are tried before all are assumed to be invalid, where values are drawn.
pub const TRIES_MAX: usize = 20;

/// Which ports the figures of merit before a run are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ports {
    /// Those of the participants that this program contains. Where there are others, the figures are not known.
    Builtin,
    /// Those of all participants: other programs are started, to describe theirs.
    Queried,
}

/// Checks the first point, and returns its figures of merit. If it is rejected, up to `tries` points are tried until one is
/// accepted.
///
/// # Errors
/// The mistake in the first point.
pub fn known_figures(campaign: &Campaign, tries: usize, ports: Ports) -> Result<Figures, CampaignError> {
    let mut first = None;
    for point in 0..tries.min(campaign.points.len()) {
        match figures_at(campaign, point, ports) {
            Ok(known) => return Ok(known),
            Err(error) => first = first.or(Some(error)),
        }
    }
    first.map_or_else(|| Ok(Figures::new(Vec::new(), Vec::new())), Err)
}

/// The watch of a stopping rule over a campaign with these figures of merit.
///
/// # Errors
/// When the rule does not fit the scenario.
pub fn watch(until: &Until, known: &Figures) -> Result<Watch, CampaignError> {
    until.check(!known.criteria.is_empty())?;
    until.watch(&known.ordered())
}

/// Prints the warnings that the changes of single points cause, such as a fault that begins after the end of the run. Only the first
/// points and the first warnings: a campaign may have very many.
pub fn print_warnings_of_points(campaign: &Campaign, scenario: &Scenario) {
    const POINTS_MAX: usize = 200;
    const SHOWN_MAX: usize = 10;
    let mut known = catalogue().warnings_with(scenario, &[]);
    let (mut shown, mut more) = (0, 0);
    for at in 0..campaign.points.len().min(POINTS_MAX) {
        // A point that does not exist, or is refused, is reported as such.
        let spec = campaign.spec_of(at).ok().filter(|_| campaign.refused_at(at).is_none());
        let Some(Ok(one)) = spec.map(|spec| Scenario::of(catalogue(), spec, &campaign.scenario)) else {
            continue;
        };
        for warning in catalogue().warnings_with(&one, &[]) {
            if known.contains(&warning) {
                continue;
            }
            if shown < SHOWN_MAX {
                shown += 1;
                let values: Vec<&str> = campaign
                    .columns
                    .iter()
                    .map(|column| column.texts[at].as_str())
                    .collect();
                eprintln!("warning: point {} ({}): {warning}", at + 1, values.join(", "));
            } else {
                more += 1;
            }
            known.push(warning);
        }
    }
    if more > 0 {
        eprintln!("warning: and {more} more of the first {POINTS_MAX} points");
    }
}

/// Checks point `at` (from 0), and returns its figures of merit.
fn figures_at(campaign: &Campaign, at: usize, ports: Ports) -> Result<Figures, CampaignError> {
    if let Some(reason) = campaign.refused_at(at) {
        return Err(CampaignError::Impossible {
            point: at + 1,
            reason: reason.to_owned(),
        });
    }
    let scenario = Scenario::of(catalogue(), campaign.spec_of(at)?, &campaign.scenario)?;
    let mut known = check(&scenario)?;
    if ports == Ports::Queried && !known.unknown().is_empty() {
        let options = run::Options {
            interrupt: signals::interrupt(),
            ..run::Options::default()
        };
        known = check_with_programs(&scenario, &options)?;
    }
    Ok(campaign::figures_of(&scenario, &known.plan))
}
