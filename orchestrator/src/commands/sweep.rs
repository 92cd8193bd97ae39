//! `escapement sweep SCENARIO --vary KEY=VALUES`

use crate::program::catalogue;
use crate::{signals, terminal};
use std::path::PathBuf;

use clap::Args;

use crate::cli::ScenarioArgs;
use engine::assessment::Criterion;
use engine::campaign::{
    self, Axis, Campaign, CampaignError, CampaignFile, Finished, GridError, Kind, Number, Options, Picture, Plan,
};
use engine::run::check;
use engine::scenario::Scenario;

/// Run a scenario over a grid of values or over what a campaign file draws, and make one table, a picture and a report.
///
/// A campaign file names a scenario and says how its keys are dispersed (docs/campaigns.md): sweep CAMPAIGN.toml.
///
/// Values are a list (5ms,10ms), a range with both ends (0ms..200ms:10ms), whole numbers (seed=1..100) or texts
/// (participants.controller.parameters.law=hierarchical,reference). Several --vary make all combinations.
///
/// Each point runs in a worker process without a tape; a point that is refused, fails or crashes is a row of the table with the
/// reason. The table does not depend on the number of workers. The same command again goes on where an interrupted sweep was.
///
/// Exit codes: 0 all points ran, whatever their criteria say; 1 a point did not run to its end, or the sweep was stopped; 2 the scenario, the
/// grid or the folder is wrong, nothing was run.
#[derive(Debug, Args)]
pub struct SweepArgs {
    /// The scenario, or a campaign file
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// A key of the scenario and its values, such as connections.measured.delay=0ms..200ms:10ms (may be given more than once)
    #[arg(long, value_name = "KEY.PATH=VALUES")]
    pub vary: Vec<String>,
    /// So many seeds from the scenario's on: the same as --vary seed=FIRST..LAST
    #[arg(long, value_name = "COUNT")]
    pub seeds: Option<u64>,
    /// The figure of merit that the picture and the quantiles show, such as position_error_at_grasp
    #[arg(long, value_name = "NAME")]
    pub figure: Option<String>,
    /// Everything about how the points are run
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// What all campaigns take.
#[derive(Debug, Args)]
pub struct CampaignArgs {
    /// The folder for table, picture and journal; one that is named after the scenario and the points when not given
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Processes that work side by side; one a core when not given
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub workers: Option<u16>,
    /// Keep the run folder of every point, tape and all
    #[arg(long)]
    pub keep: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// No progress line and no summary
    #[arg(long)]
    pub quiet: bool,
}

impl CampaignArgs {
    /// For the campaign.
    pub fn options(&self) -> Options {
        Options {
            out: self.out.clone(),
            workers: self.workers.map(usize::from),
            keep: self.keep,
            progress: terminal::progress(self.quiet),
            interrupt: signals::interrupt(),
        }
    }
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
    let overrides = args.scenario.overrides();
    let file = declared(args)?;
    let path = file.as_ref().map_or(&*args.scenario.scenario, CampaignFile::scenario);
    let scenario = Scenario::read(catalogue(), path, &overrides)?;
    let plan = match &file {
        Some(file) => file.plan(&scenario)?,
        None => listed(args, &scenario, &overrides)?,
    };
    let campaign = Campaign::of_plan(Kind::Sweep, path.to_owned(), overrides, &plan);
    // Where values are drawn, the first of them may be one that cannot be; of a grid somebody wrote every value.
    let tries = if file.is_some() { TRIES } else { 1 };
    let figures = known_figures(&campaign, tries).map_err(|error| match &file {
        Some(file) => file.blame(&plan, error, tries.min(campaign.points.len())),
        None => error,
    })?;
    let figure = match &args.figure {
        Some(name) => Some(campaign::figure_of(name, &figures)?),
        None => None,
    };
    let finished = campaign::run(&campaign, &scenario, &args.campaign.options())?;
    let shown = figure.clone().or_else(|| default_figure(&figures));
    let limited = |criterion: &Criterion| criterion.limit.is_some_and(|limit| limit > 0.0);
    let judged = finished
        .results
        .iter()
        .flatten()
        .filter_map(|result| result.figures.as_ref());
    let judged = judged.flat_map(|figures| &figures.criteria).any(limited);
    let varied = campaign.columns.iter().filter(|column| column.name != "seed").count();
    let own = file.as_ref().map_or("", CampaignFile::title);
    let title = [own, &scenario.title, &scenario.name];
    let title = title.into_iter().find(|title| !title.is_empty()).unwrap_or_default();
    let picture = Picture {
        title,
        columns: &campaign.columns,
        results: &finished.results,
        // over one key all criteria are shown, unless there are none or the user asks for one figure
        figure: if varied > 1 || !judged {
            shown.as_ref()
        } else {
            figure.as_ref()
        },
    };
    let mut pictures = write(&campaign, &finished, Some(&picture))?;
    pictures.push(write_page(title, &campaign, &plan, &finished)?);
    if args.campaign.json {
        println!("{}", json(&campaign, &finished, &pictures));
    } else if !args.campaign.quiet {
        print(&scenario, &campaign, &finished, shown.as_ref(), &pictures);
    }
    Ok(code(&finished))
}

/// So many points are tried before all of them are taken to be wrong.
const TRIES: usize = 20;

/// The campaign that the file declares, unless the command line says itself what varies.
fn declared(args: &SweepArgs) -> Result<Option<CampaignFile>, CampaignError> {
    let file = CampaignFile::open(&args.scenario.scenario)?;
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
        _ => Ok(None),
    }
}

/// The grid of the command line.
fn listed(args: &SweepArgs, scenario: &Scenario, overrides: &[String]) -> Result<Plan, CampaignError> {
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
        let fixed = overrides
            .iter()
            .find(|one| one.split('=').next().map(str::trim) == Some(&*axis.key));
        // --seeds starts from the scenario's seed, given or not
        if fixed.is_some() && !(axis.key == "seed" && args.seeds.is_some()) {
            return Err(grid_error(&axis.key, "is given with --set or an option as well: vary it or fix it").into());
        }
    }
    let (columns, points) = campaign::grid(&axes)?;
    Ok(Plan::Listed { columns, points })
}

/// The exit code: whether all points ran.
pub fn code(finished: &Finished) -> i32 {
    if finished.interrupted {
        eprintln!(
            "interrupted: {} of {} points are complete; the same command goes on from there",
            finished.results.iter().flatten().count(),
            finished.results.len()
        );
    }
    i32::from(!finished.all_ran())
}

/// Checks the first point with everything but launch, and says which figures of merit there are. Where it is refused, up to `tries`
/// points are tried for one that is not.
///
/// # Errors
/// What is wrong with the first one.
pub fn known_figures(campaign: &Campaign, tries: usize) -> Result<Vec<Number>, CampaignError> {
    let mut first = None;
    for point in campaign.points.iter().take(tries) {
        let changes = [campaign.overrides.as_slice(), point].concat();
        let scenario = Scenario::read(catalogue(), &campaign.scenario, &changes).map_err(CampaignError::from);
        let known = scenario.and_then(|scenario| {
            let known = check(&scenario)?;
            Ok(campaign::figures_of(&scenario, &known.plan))
        });
        match known {
            Ok(known) => return Ok(known),
            Err(error) => first = first.or(Some(error)),
        }
    }
    first.map_or(Ok(Vec::new()), Err)
}

/// What is shown unless the user says: the first thing that the run is judged by.
pub fn default_figure(figures: &[Number]) -> Option<Number> {
    figures.first().cloned()
}

/// Writes table and picture; gives the files.
pub fn write(
    campaign: &Campaign,
    finished: &Finished,
    picture: Option<&Picture<'_>>,
) -> Result<Vec<PathBuf>, CampaignError> {
    let sheet = campaign::sheet(campaign, &finished.results);
    let root = finished.folder.root();
    let mut files = vec![root.join("table.csv"), root.join("table.parquet")];
    sheet.csv(&files[0])?;
    sheet.parquet(&files[1])?;
    if let Some(drawing) = picture.and_then(campaign::draw) {
        files.push(finished.folder.write("figure.svg", report::figures::svg(&drawing))?);
        if let Some(png) = report::figures::png(&drawing, 2.5) {
            files.push(finished.folder.write("figure.png", png)?);
        }
    }
    Ok(files)
}

/// Writes the page with the statistics; gives the file.
pub fn write_page(
    title: &str,
    campaign: &Campaign,
    plan: &Plan,
    finished: &Finished,
) -> Result<PathBuf, CampaignError> {
    let data = campaign::analysis(title, campaign, plan, &finished.results);
    finished
        .folder
        .write("report.html", report::campaign::page(title, &data))
}

/// The campaign as JSON: counts, files, and every row.
pub fn json(campaign: &Campaign, finished: &Finished, files: &[PathBuf]) -> serde_json::Value {
    let rows = finished.results.iter().enumerate().map(|(at, result)| {
        let values = campaign
            .columns
            .iter()
            .map(|column| (column.name.clone(), column.json(at)));
        let figures = result.as_ref().and_then(|result| result.figures.as_ref());
        let figures = figures.map(|figures| {
            figures
                .numbers
                .iter()
                .map(|number| (number.key.clone(), number.value))
                .collect::<std::collections::BTreeMap<_, _>>()
        });
        serde_json::json!({
            "point": at + 1,
            "values": values.collect::<serde_json::Map<_, _>>(),
            "outcome": result.as_ref().map(|result| result.outcome.word()),
            "reason": result.as_ref().and_then(|result| result.reason.clone()),
            "figures": figures,
            "tape_digest": result.as_ref().and_then(|result| result.tape.clone()),
        })
    });
    let count = |outcome| finished.count(outcome);
    // JSON is text; a path need not be.
    let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    serde_json::json!({
        "folder": finished.folder.root().display().to_string(),
        "files": files,
        "points": finished.results.len(),
        "met": count(campaign::Outcome::Met),
        "not_met": count(campaign::Outcome::NotMet),
        "complete": count(campaign::Outcome::Complete),
        "refused": count(campaign::Outcome::Refused),
        "failed": count(campaign::Outcome::Failed),
        "crashed": count(campaign::Outcome::Crashed),
        "interrupted": finished.interrupted,
        "rows": rows.collect::<Vec<_>>(),
    })
}

fn print(scenario: &Scenario, campaign: &Campaign, finished: &Finished, figure: Option<&Number>, files: &[PathBuf]) {
    if !scenario.title.is_empty() {
        println!("{}", scenario.title);
    }
    println!("{}", campaign::verdicts(&finished.results));
    if campaign.columns.iter().any(|column| column.name == "seed") {
        let ran = finished
            .results
            .iter()
            .flatten()
            .filter(|result| result.outcome.ran())
            .count();
        let good = finished
            .results
            .iter()
            .flatten()
            .filter(|result| result.outcome.good())
            .count();
        let (low, high) = campaign::wilson(good, ran);
        println!(
            "  {} {good} of {ran}: a share of {:.1} % to {:.1} % with 95 % confidence",
            campaign::good_word(&finished.results),
            100.0 * low,
            100.0 * high
        );
    }
    if let Some(figure) = figure {
        let values = finished
            .results
            .iter()
            .flatten()
            .filter_map(|result| campaign::figure_value(result, &figure.key));
        if let Some([least, median, most, greatest]) = campaign::quantiles(values) {
            let [least, median, most, greatest] = [least, median, most, greatest].map(campaign::short);
            println!(
                "  {}: {least} to {greatest}{}, median {median}, 95 % up to {most}",
                figure.words(),
                engine::assessment::behind(&figure.unit)
            );
        }
    }
    if let [column] = &campaign.columns[..]
        && column.name != "seed"
    {
        println!(
            "  {} at {}: {}",
            campaign::good_word(&finished.results),
            column.name,
            campaign::stretches(column, &finished.results)
        );
    }
    if let Some(map) = campaign::map(&campaign.columns, &finished.results) {
        println!("{map}");
    }
    for (at, result) in finished.results.iter().enumerate() {
        if let Some(result) = result.as_ref().filter(|result| !result.outcome.ran()) {
            let values: Vec<&str> = campaign
                .columns
                .iter()
                .map(|column| column.texts[at].as_str())
                .collect();
            let reason = result.reason.as_deref().unwrap_or_default();
            println!("  {} at {}: {reason}", result.outcome.word(), values.join(", "));
        }
    }
    told(finished, files);
}

/// Time and files.
pub fn told(finished: &Finished, files: &[PathBuf]) {
    let before = if finished.resumed > 0 {
        format!(" ({} were there)", finished.resumed)
    } else {
        String::new()
    };
    println!("{:.1} s{before}", finished.wall_s);
    for file in files {
        println!("{}", file.display());
    }
}
