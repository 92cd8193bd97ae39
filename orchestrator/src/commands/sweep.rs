//! `escapement sweep SCENARIO --vary KEY=VALUES`: a campaign over a grid of values, or over a campaign file.

use clap::Args;

use super::cluster::ClusterArgs;
use super::conclusion::{conclude, conclude_rare};
use super::points::{
    CampaignArgs, DigestArgs, Ports, ShardArgs, TRIES_MAX, known_figures, print_warnings_of_points, watch,
};
use crate::arguments::ScenarioArgs;
use crate::catalogue::catalogue;
use engine::campaign::{
    self, Axis, Campaign, CampaignError, CampaignFile, CampaignKind, GridError, Options, Plan, Until,
};
use engine::scenario::{Changes, Scenario};

/// Arguments of `sweep`.
#[derive(Debug, Args)]
pub struct SweepArgs {
    /// The scenario, or a campaign file
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// A key of the scenario and its values, such as connections.measured.delay=0ms..200ms:10ms (may be given more than once)
    #[arg(long, value_name = "KEY.PATH=VALUES")]
    pub vary: Vec<String>,
    /// The number of seeds, from that of the scenario on: the same as --vary seed=FIRST..LAST
    #[arg(long, value_name = "COUNT")]
    pub seeds: Option<u64>,
    /// The number of points to draw, instead of that of the campaign file; a larger number extends an existing campaign
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["vary", "seeds"], value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub points: Option<u32>,
    /// The figure of merit that the chart and the quantiles show, such as position_error_at_grasp
    #[arg(long, value_name = "NAME")]
    pub figure: Option<String>,
    /// End as soon as the 95 % confidence interval is narrow enough: 'met within 1 %' for the proportion of points that meet the criteria,
    /// or 'FIGURE within 2 %' for the mean of a figure of merit
    #[arg(long, value_name = "WHAT within WIDTH", conflicts_with = "shard")]
    pub until: Option<Until>,
    /// What the table has besides figures
    #[command(flatten)]
    pub digest: DigestArgs,
    /// Which part of the points
    #[command(flatten)]
    pub sharding: ShardArgs,
    /// On which machines
    #[command(flatten)]
    pub cluster: ClusterArgs,
    /// Everything about how the points are run
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// Runs the grid and reports.
pub fn run(args: &SweepArgs) -> anyhow::Result<i32> {
    match sweep(args) {
        Ok(code) => Ok(code),
        Err(error) => {
            eprintln!("error: {error}");
            Ok(error.exit_code())
        }
    }
}

fn sweep(args: &SweepArgs) -> Result<i32, CampaignError> {
    let overrides = args.scenario.changes();
    let file = declared_campaign(args)?;
    let path = file.as_ref().map_or(&*args.scenario.scenario, CampaignFile::scenario);
    let scenario = Scenario::changed(catalogue(), path, &overrides)?;
    let plan = match &file {
        Some(file) => check_draws_not_overridden(file.plan(&scenario)?, &overrides)?,
        None => grid_plan(args, &scenario, &overrides)?,
    };
    if args.until.is_some() {
        check_early_stop(args, &plan)?;
    }
    let campaign = match &file {
        Some(file) => file.campaign(overrides, &plan),
        None => Campaign::of_plan(CampaignKind::Sweep, path.to_owned(), overrides, &plan),
    };
    let campaign = Campaign {
        digests: args.sharding.audit.is_some() || args.digest.includes_digests(&args.campaign),
        ..campaign
    };
    // Where values are drawn, the first point may be an impossible one; the values of a grid were all given by the user.
    let tries = if file.is_some() { TRIES_MAX } else { 1 };
    let ports = if needs_figures(args, file.as_ref()) {
        Ports::Queried
    } else {
        Ports::Builtin
    };
    let known = known_figures(&campaign, tries, ports).map_err(|error| match &file {
        Some(file) => file.attribute_mistake(&plan, error, tries.min(campaign.points.len())),
        None => error,
    })?;
    let figures = known.ordered();
    match &file {
        Some(file) => file.check_names(&plan, &figures)?,
        None => print_warnings_of_points(&campaign, &scenario),
    }
    let figure = match &args.figure {
        Some(name) => Some(campaign::figure_of(name, &figures)?),
        None => None,
    };
    let options = Options {
        // For seeds alone, and for draws, the points after the first 200 are the same whether they are added now or later.
        grows: match &campaign.source {
            Some(source) => source.grows,
            None => args.vary.is_empty(),
        },
        figure: figure.clone(),
        until: args.until.as_ref().map(|until| watch(until, &known)).transpose()?,
        ..args.sharding.options(args.campaign.options())?
    };
    if let Some(file) = &file
        && let Some(rare) = file.rare(&plan)?
    {
        check_single_machine(args)?;
        let criterion = file.criterion(&rare, &known.criteria, &scenario)?;
        let ended = rare.run(campaign, &plan, criterion, &scenario, &options)?;
        return conclude_rare(&ended, figure.as_ref(), &args.campaign);
    }
    if let Some(code) =
        args.cluster
            .submit_or_bundle(&campaign, &scenario, &options, figure.as_ref(), &args.campaign)?
    {
        return Ok(code);
    }
    let finished = campaign::run(&campaign, &scenario, &options)?;
    conclude(&campaign, &finished, &figures, figure.as_ref(), &args.campaign)
}

/// Whether names on the command line or in the campaign file refer to figures of merit, so that they must be known before a run.
fn needs_figures(args: &SweepArgs, file: Option<&CampaignFile>) -> bool {
    args.figure.is_some() || args.until.is_some() || file.is_some_and(CampaignFile::is_rare)
}

/// Checks that the first points of a plan are a valid sample, whatever their number.
fn check_early_stop(args: &SweepArgs, plan: &Plan) -> Result<(), CampaignError> {
    let path = args.scenario.scenario.display();
    let reason = match plan {
        Plan::Declared(declared) => declared.needs_all().map(|design| {
            format!(
                "{path} has the design {}, which needs all of its points: leave --until out, or let the design random or sobol make the points",
                design.name()
            )
        }),
        // The first points of a grid have the first values alone; seeds are all alike.
        Plan::Listed { columns, .. } => columns.iter().find(|column| column.name != "seed").map(|column| {
            format!(
                "the grid over {} needs all of its points: leave --until out, or vary the seed alone",
                column.name
            )
        }),
    };
    reason.map_or(Ok(()), |reason| Err(CampaignError::Until(reason)))
}

/// A rare-event campaign runs on one machine: points of a level depend on those of the level before it.
fn check_single_machine(args: &SweepArgs) -> Result<(), CampaignError> {
    let given = [
        ("--until", args.until.is_some()),
        ("--shard", args.sharding.shard.is_some()),
        ("--audit", args.sharding.audit.is_some()),
        ("--on", args.cluster.on.is_some()),
        ("--bundle", args.cluster.bundle.is_some()),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(CampaignError::Rare(format!(
            "{option}: points of the design subset depend on those before them, so all are run here and to the end: leave it out"
        ))),
        None => Ok(()),
    }
}

/// The campaign that the file declares, unless the command line gives the variations.
fn declared_campaign(args: &SweepArgs) -> Result<Option<CampaignFile>, CampaignError> {
    let file = CampaignFile::open(&args.scenario.scenario)?;
    if let Some(points) = args.points {
        let file = file.ok_or_else(|| {
            let path = args.scenario.scenario.display();
            let reason =
                format!("{path} is not a campaign file: a grid has its values, and --seeds COUNT says how many seeds");
            CampaignError::Points(reason)
        })?;
        return Ok(Some(file.with_points(points)));
    }
    if args.vary.is_empty() && args.seeds.is_none() {
        return Ok(file);
    }
    match file {
        Some(file) if file.scenario() != args.scenario.scenario => {
            let path = args.scenario.scenario.display();
            let text = args.vary.first().cloned().unwrap_or_else(|| "--seeds".to_owned());
            let reason = format!("{path} says what varies: add a table [vary.NAME] to it, or sweep its scenario");
            Err(GridError { text, reason }.into())
        }
        Some(_) => {
            let path = args.scenario.scenario.display();
            eprintln!("warning: {path}: [campaign] is not used, because the command line gives what varies");
            Ok(None)
        }
        None => Ok(None),
    }
}

/// Checks that no dispersion of the plan draws a value that the command line fixes; returns the plan.
fn check_draws_not_overridden(plan: Plan, overrides: &Changes) -> Result<Plan, CampaignError> {
    let Plan::Declared(declared) = &plan else {
        return Ok(plan);
    };
    for dispersion in declared.dispersions().iter().filter(|one| one.replaces()) {
        let mut whole = dispersion.targets.iter().filter(|target| target.element.is_none());
        if let Some(target) = whole.find(|target| overrides.fixes(&target.key)) {
            let reason = format!(
                "is given with --set or an option, and `vary.{}` draws it: take one out",
                dispersion.name
            );
            return Err(GridError {
                text: target.key.clone(),
                reason,
            }
            .into());
        }
    }
    Ok(plan)
}

/// The grid of the command line.
fn grid_plan(args: &SweepArgs, scenario: &Scenario, overrides: &Changes) -> Result<Plan, CampaignError> {
    let mut axes: Vec<Axis> = args.vary.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    if let Some(count) = args.seeds {
        axes.push(campaign::range_of_seeds(scenario.seed, count)?);
    }
    let grid_error = |text: &str, reason: &str| GridError {
        text: text.to_owned(),
        reason: reason.to_owned(),
    };
    if axes.is_empty() {
        let reason =
            "is missing: say what to vary, such as connections.measured.delay=0ms..200ms:10ms, or name a campaign file";
        return Err(grid_error("KEY.PATH=VALUES", reason).into());
    }
    for axis in &axes {
        // --seeds starts from the scenario's seed, given or not
        if overrides.fixes(&axis.key) && !(axis.key == "seed" && args.seeds.is_some()) {
            return Err(grid_error(&axis.key, "is given with --set or an option as well: vary it or fix it").into());
        }
    }
    let (columns, points) = campaign::grid(&axes)?;
    Ok(Plan::Listed { columns, points })
}
