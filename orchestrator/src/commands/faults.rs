//! `escapement faults SCENARIO`: a campaign over single failures, declared or listed by the program.

use crate::catalogue::catalogue;
use std::path::PathBuf;

use clap::Args;
use lockstep::time::Rational;

use super::conclusion::{exit_code, json, print_time_and_files, write};
use super::points::{CampaignArgs, DigestArgs, Ports, known_figures, print_warnings_of_points};
use crate::arguments::{ScenarioArgs, parse_instant};
use engine::campaign::{self, Campaign, CampaignError, CampaignKind, Finished};
use engine::run::RunFailure;
use engine::scenario::Scenario;

/// Arguments of `faults`.
#[derive(Debug, Args)]
pub struct FaultsArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// A file with the cases
    #[arg(long, value_name = "FILE", conflicts_with_all = ["at", "informed"])]
    pub cases: Option<PathBuf>,
    /// Let every failure begin at this simulated time too, such as 12s, in addition to the start (may be given more than once)
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub at: Vec<Rational>,
    /// Run wheel and joint failures a second time with a control law that is informed of them: thruster couples support the wheels, and a
    /// failed joint has the weight zero
    #[arg(long)]
    pub informed: bool,
    /// Print the table as Markdown
    #[arg(long, conflicts_with = "json")]
    pub markdown: bool,
    /// What the table has besides figures
    #[command(flatten)]
    pub digest: DigestArgs,
    /// Everything about how the points are run
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// Runs the cases and reports.
pub fn run(args: &FaultsArgs) -> anyhow::Result<i32> {
    match faults(args) {
        Ok(code) => Ok(code),
        Err(error) => {
            eprintln!("error: {error}");
            Ok(error.exit_code())
        }
    }
}

fn faults(args: &FaultsArgs) -> Result<i32, CampaignError> {
    let overrides = args.scenario.changes();
    let file = &args.scenario.scenario;
    let scenario = Scenario::changed(catalogue(), file, &overrides)?;
    if let Some(at) = args.at.iter().find(|at| **at >= scenario.duration) {
        return Err(RunFailure::Option {
            option: "--at",
            value: at.to_string(),
            reason: format!("is not before the end at {}: give an earlier time", scenario.duration),
        }
        .into());
    }
    let cases = match &args.cases {
        Some(list) => campaign::cases_from_file(list, &scenario)?,
        None => catalogue().every_failure(&scenario, file, &args.at, args.informed)?,
    };
    let campaign = Campaign {
        kind: CampaignKind::Faults,
        scenario: file.clone(),
        overrides,
        columns: cases.columns,
        points: cases.points,
        refused: Vec::new(),
        source: None,
        digests: args.digest.includes_digests(&args.campaign),
    };
    known_figures(&campaign, 1, Ports::Builtin).map_err(|error| match (&args.cases, error) {
        (Some(list), CampaignError::Scenario(error)) => campaign::locate_in_first_case(list, error).into(),
        (_, error) => error,
    })?;
    print_warnings_of_points(&campaign, &scenario);
    let finished = campaign::run(&campaign, &scenario, &args.campaign.options())?;
    let mut files = write(&campaign, &finished, None)?;
    let title = if cases.title.is_empty() {
        finished.identity.heading()
    } else {
        &cases.title
    };
    let page = report::campaign::page(title, &campaign::of_cases(title, &campaign, &finished.results));
    files.push(finished.folder.write("report.html", page)?);
    if args.campaign.json {
        println!("{}", json(&campaign, &finished, &files));
    } else if args.markdown {
        print!("{}", table(&campaign, &finished, true));
    } else if !args.campaign.quiet {
        for title in [&scenario.title, &cases.title] {
            if !title.is_empty() {
                println!("{title}");
            }
        }
        println!("{}", campaign::verdicts(&finished.results));
        print!("{}", table(&campaign, &finished, false));
        print_time_and_files(&finished, &files);
    }
    Ok(exit_code(&finished))
}

/// A line per case: its description, its outcome, and the criteria that decided it.
fn table(campaign: &Campaign, finished: &Finished, markdown: bool) -> String {
    let judged = finished
        .results
        .iter()
        .flatten()
        .find_map(|result| result.figures.as_ref());
    let criteria = judged.map_or(&[][..], |figures| &figures.criteria);
    let mut lines = vec![{
        let mut line: Vec<String> = campaign.columns.iter().map(|column| column.name.clone()).collect();
        line.push("outcome".into());
        line.extend(criteria.iter().map(|criterion| {
            let unit = if criterion.unit == "1" {
                String::new()
            } else {
                format!(" [{}]", criterion.unit)
            };
            criterion.name.replace('_', " ") + &unit
        }));
        line
    }];
    for (at, result) in finished.results.iter().enumerate() {
        let mut line: Vec<String> = campaign.columns.iter().map(|column| column.texts[at].clone()).collect();
        line.push(campaign::outcome_name(result.as_ref()).to_owned());
        let own = result.as_ref().and_then(|result| result.figures.as_ref());
        for (number, _) in criteria.iter().enumerate() {
            let value = own.and_then(|figures| figures.criteria.get(number)?.value);
            line.push(value.map_or(String::new(), engine::three_digits));
        }
        if own.is_none() {
            line.extend(result.as_ref().and_then(|result| result.reason.clone()));
        }
        lines.push(line);
    }
    let columns = lines[0].len();
    let width = |column: usize| {
        lines
            .iter()
            .filter_map(|line| line.get(column))
            .map(|cell| cell.chars().count())
            .max()
    };
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    let mut out = String::new();
    for (number, line) in lines.iter().enumerate() {
        if markdown {
            out += &format!("| {} |\n", line.join(" | "));
            if number == 0 {
                out += &format!("|{}\n", "---|".repeat(columns));
            }
        } else {
            let cells = line.iter().enumerate().map(|(at, cell)| match widths.get(at) {
                Some(width) => format!("{cell:<width$}"),
                None => cell.clone(),
            });
            out += cells.collect::<Vec<_>>().join("  ").trim_end();
            out.push('\n');
        }
    }
    out
}
