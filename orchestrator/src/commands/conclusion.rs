//! Conclusion of a campaign: table, charts and page in its folder, and the printed report.

use std::path::PathBuf;

use engine::assessment::Criterion;
use engine::campaign::{
    self, Campaign, CampaignError, ChartContent, Finished, Number, Outcome, PointResult, RareEventResult, Shard, Until,
};

use super::points::CampaignArgs;

/// Writes table, charts and page of a campaign and reports; for a shard none are written, because its table would have
/// gaps.
pub fn conclude(
    campaign: &Campaign,
    finished: &Finished,
    figures: &[Number],
    figure: Option<&Number>,
    args: &CampaignArgs,
) -> Result<i32, CampaignError> {
    let identity = &finished.identity;
    let some = campaign.first(finished.results.len());
    let all = campaign.points.len();
    let enough = some.points.len() < all;
    let campaign = if enough { &some } else { campaign };
    let title = identity.heading();
    if let Some(shard) = identity.shard {
        print_shard(title, shard, campaign, finished, args);
        return Ok(exit_code(finished));
    }
    let shown = figure.cloned().or_else(|| default_figure(figures));
    let limited = |criterion: &Criterion| criterion.limit.is_some_and(|limit| limit > 0.0);
    let judged = finished
        .results
        .iter()
        .flatten()
        .filter_map(|result| result.figures.as_ref());
    let judged = judged.flat_map(|figures| &figures.criteria).any(limited);
    let varied = campaign.columns.iter().filter(|column| column.name != "seed").count();
    let chart = ChartContent {
        title,
        columns: &campaign.columns,
        results: &finished.results,
        // over one key all criteria are shown, unless there are none or the user asks for one figure
        figure: if varied > 1 || !judged { shown.as_ref() } else { figure },
    };
    let mut files = write(campaign, finished, Some(&chart))?;
    let page = campaign::analysis(title, campaign, &finished.results);
    let page = report::campaign::page(title, &page);
    files.push(finished.folder.write("report.html", page)?);
    let precision = identity
        .until
        .as_ref()
        .map(|until| Precision::of(until, figures, finished));
    if args.json {
        let mut all = json(campaign, finished, &files);
        if let Some(precision) = &precision {
            all["until"] = precision.json();
        }
        println!("{all}");
    } else if !args.quiet {
        if enough {
            println!(
                "the stopping rule is reached after {} of {all} points",
                finished.results.len()
            );
        }
        print(&identity.title, campaign, finished, shown.as_ref(), &files);
    }
    if let Some(precision) = precision.filter(|precision| !precision.reached && !finished.interrupted) {
        eprintln!("warning: {}", precision.describe());
    }
    Ok(exit_code(finished))
}

/// What a campaign with a stopping rule knows at its end.
struct Precision {
    rule: String,
    reached: bool,
    /// The half width of the interval, percent as in the rule.
    percent: Option<f64>,
    points: usize,
}

impl Precision {
    fn of(until: &Until, figures: &[Number], finished: &Finished) -> Precision {
        let watch = until.watch(figures);
        let (percent, reached) = watch.map_or((None, false), |watch| watch.reached(&finished.results));
        Precision {
            rule: until.to_string(),
            reached,
            percent,
            points: finished.results.len(),
        }
    }

    fn describe(&self) -> String {
        let Precision { rule, points, .. } = self;
        match self.percent {
            Some(percent) => {
                let percent = engine::three_digits(percent);
                format!("`{rule}` was not reached: {points} points give {percent} %; add points with --points")
            }
            None => format!("`{rule}` was not reached with {points} points: the interval is not known"),
        }
    }

    fn json(&self) -> serde_json::Value {
        serde_json::json!({ "rule": self.rule, "reached": self.reached, "within_percent": self.percent })
    }
}

/// The figures of merit of the points.
pub fn figures(finished: &Finished) -> Vec<Number> {
    let mut all = finished.results.iter().flatten();
    let first = all.find_map(|result| result.figures.as_ref());
    first.map_or(Vec::new(), |figures| figures.ordered())
}

/// The same for a rare-event campaign. Charts and statistics are of its first level, which is a plain random sample.
pub fn conclude_rare(
    ended: &RareEventResult,
    figure: Option<&Number>,
    args: &CampaignArgs,
) -> Result<i32, CampaignError> {
    let RareEventResult { campaign, finished, .. } = ended;
    let identity = &finished.identity;
    let title = identity.heading();
    let first = campaign.first(ended.sample);
    let sample = &finished.results[..ended.sample.min(finished.results.len())];
    let chart = ChartContent {
        title,
        columns: &first.columns,
        results: sample,
        figure,
    };
    let mut files = write(campaign, finished, Some(&chart))?;
    files.push(finished.folder.write("rare.json", format!("{:#}\n", ended.json()))?);
    let page = report::campaign::page(title, &ended.analysis(title));
    files.push(finished.folder.write("report.html", page)?);
    if args.json {
        let mut all = json(campaign, finished, &files);
        all["rare"] = ended.json();
        println!("{all}");
    } else if !args.quiet {
        if !identity.title.is_empty() {
            println!("{}", identity.title);
        }
        println!("{}", ended.to_text());
        print_failed_points(campaign, finished);
        print_time_and_files(finished, &files);
    }
    Ok(exit_code(finished))
}

/// The exit code: whether all points ran.
pub fn exit_code(finished: &Finished) -> i32 {
    if finished.interrupted {
        eprintln!(
            "interrupted: {} of {} points are complete; the same command continues from there",
            finished.results.iter().flatten().count(),
            finished.own()
        );
    }
    i32::from(!finished.all_ran())
}

/// The default figure: the first one that the run is judged by.
pub fn default_figure(figures: &[Number]) -> Option<Number> {
    figures.first().cloned()
}

/// Writes table and chart; returns the files.
pub fn write(
    campaign: &Campaign,
    finished: &Finished,
    chart: Option<&ChartContent<'_>>,
) -> Result<Vec<PathBuf>, CampaignError> {
    let sheet = campaign::sheet(campaign, &finished.results);
    let root = finished.folder.root();
    let mut files = vec![root.join("table.csv"), root.join("table.parquet")];
    sheet.csv(&files[0])?;
    sheet.parquet(&files[1])?;
    if let Some(drawing) = chart.and_then(campaign::draw_chart) {
        files.push(finished.folder.write("figure.svg", report::figures::svg(&drawing))?);
        if let Some(png) = report::figures::png(&drawing, 2.5) {
            files.push(finished.folder.write("figure.png", png)?);
        }
    } else {
        // A chart of fewer points would look like that of all.
        for name in ["figure.svg", "figure.png"] {
            let _ = std::fs::remove_file(root.join(name));
        }
    }
    Ok(files)
}

/// The campaign as JSON: counts, files, and every row.
pub fn json(campaign: &Campaign, finished: &Finished, files: &[PathBuf]) -> serde_json::Value {
    let rows = finished.results.iter().enumerate().map(|(at, result)| {
        let figures = result.as_ref().and_then(|result| result.figures.as_ref());
        let figures = figures.map(|figures| {
            figures
                .numbers()
                .map(|number| (number.key, number.value))
                .collect::<std::collections::BTreeMap<_, _>>()
        });
        serde_json::json!({
            "point": at + 1,
            "values": campaign.values(at),
            "outcome": result.as_ref().map(|result| result.outcome.name()),
            "reason": result.as_ref().and_then(|result| result.reason.clone()),
            "figures": figures,
            "tape_digest": result.as_ref().and_then(|result| result.tape.clone()),
        })
    });
    let count = |outcome| finished.count(outcome);
    // JSON is text; a path may not be.
    let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    serde_json::json!({
        "folder": finished.folder.root().display().to_string(),
        "files": files,
        "points": finished.results.len(),
        "met": count(Outcome::Met),
        "not_met": count(Outcome::NotMet),
        "complete": count(Outcome::Complete),
        "refused": count(Outcome::Refused),
        "failed": count(Outcome::Failed),
        "crashed": count(Outcome::Crashed),
        "interrupted": finished.interrupted,
        "rows": rows.collect::<Vec<_>>(),
    })
}

/// Prints the points whose runs did not complete, with the reasons.
fn print_failed_points(campaign: &Campaign, finished: &Finished) {
    // Only the first few are printed.
    const LISTED: usize = 50;
    let wrong = |result: &Option<_>| {
        result
            .as_ref()
            .is_some_and(|result: &PointResult| !result.outcome.ran())
    };
    let wrong: Vec<usize> = (0..finished.results.len())
        .filter(|at| wrong(&finished.results[*at]))
        .collect();
    for at in wrong.iter().take(LISTED) {
        if let Some(result) = &finished.results[*at] {
            let values: Vec<&str> = campaign
                .columns
                .iter()
                .map(|column| column.texts[*at].as_str())
                .collect();
            let reason = result.reason.as_deref().unwrap_or_default();
            println!("  {} at {}: {reason}", result.outcome.name(), values.join(", "));
        }
    }
    if wrong.len() > LISTED {
        println!("  and {} more: the table has them all", wrong.len() - LISTED);
    }
}

fn print(title: &str, campaign: &Campaign, finished: &Finished, figure: Option<&Number>, files: &[PathBuf]) {
    if !title.is_empty() {
        println!("{title}");
    }
    println!("{}", campaign::verdicts(&finished.results));
    if campaign.is_sample() {
        println!("  {}", met_share_text(&finished.results));
    }
    if let Some(figure) = figure {
        let values = finished
            .results
            .iter()
            .flatten()
            .filter_map(|result| campaign::figure_value(result, &figure.key));
        if let Some([least, median, most, greatest]) = campaign::quantiles(values) {
            let [least, median, most, greatest] = [least, median, most, greatest].map(engine::three_digits);
            println!(
                "  {}: {least} to {greatest}{}, median {median}, 95 % up to {most}",
                figure.display_name(),
                engine::assessment::unit_suffix(&figure.unit)
            );
        }
    }
    if let [column] = &campaign.columns[..]
        && column.name != "seed"
        && let Some(stretches) = campaign::met_ranges(column, &finished.results)
    {
        let good = campaign::success_name(&finished.results);
        println!("  {good} at {}: {stretches}", column.name);
    }
    if let Some(map) = campaign::map(&campaign.columns, &finished.results) {
        println!("{map}");
    }
    print_failed_points(campaign, finished);
    print_time_and_files(finished, files);
}

/// The share of the points that are met, in words; it has no interval where none ran.
fn met_share_text(results: &[Option<PointResult>]) -> String {
    let count = |wanted: fn(Outcome) -> bool| results.iter().flatten().filter(|one| wanted(one.outcome)).count();
    let (ran, good) = (count(Outcome::ran), count(Outcome::good));
    if ran == 0 {
        return "no point ran to its end, so no share is known".to_owned();
    }
    let (low, high) = campaign::wilson(good, ran);
    format!(
        "{} {good} of {ran}: a share of {:.1} % to {:.1} % with 95 % confidence",
        campaign::success_name(results),
        100.0 * low,
        100.0 * high
    )
}

/// Reports the result of a shard.
fn print_shard(title: &str, shard: Shard, campaign: &Campaign, finished: &Finished, args: &CampaignArgs) {
    if args.json {
        println!("{}", json(campaign, finished, &[]));
    } else if !args.quiet {
        println!("{title}, shard {shard}");
        let own = finished
            .results
            .iter()
            .enumerate()
            .filter(|(at, _)| finished.identity.owns(*at));
        let own: Vec<_> = own.map(|(_, result)| result.clone()).collect();
        println!("{}", campaign::verdicts(&own));
        print_time_and_files(finished, &[finished.folder.root().to_owned()]);
    }
}

/// Prints the wall-clock time and the files.
pub fn print_time_and_files(finished: &Finished, files: &[PathBuf]) {
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
