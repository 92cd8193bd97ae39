//! `escapement report RUN [RUN…]`: one page about one run or several.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use report::page::{Report, Request};

use super::outputs::register_outputs;
use super::seal::{SealArgs, read_error_text};
use crate::arguments::parse_model;
use crate::catalogue::catalogue;
use crate::destination;
use crate::line::Busy;

/// Exit code: a folder is not a run, or a file of it cannot be read.
const UNREADABLE: i32 = 2;

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Run folders
    #[arg(required = true)]
    pub runs: Vec<PathBuf>,
    /// The file for the page [default: `report.html` in the first run folder]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// A name for each run, in the order of the runs [default: the differences between the scenarios, or the folder's name]
    #[arg(long, value_name = "NAME")]
    pub label: Vec<String>,
    /// Also write the figures as SVG and PNG into this folder: those that the scenario selects, or all if it selects none
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// A URDF for a body of the playback, instead of that of the scene (may be given more than once)
    #[arg(long, value_name = "BODY=URDF", value_parser = parse_model)]
    pub model: Vec<(String, PathBuf)>,
    /// Whether damaged tapes are reported
    #[command(flatten)]
    pub seal: SealArgs,
}

/// Reads the runs, writes the page and prints its path; returns the exit code.
pub fn run(args: &ReportArgs) -> anyhow::Result<i32> {
    let start = Instant::now();
    for (option, path) in [("--out", &args.out), ("--figures", &args.figures)] {
        path.iter().try_for_each(|path| destination::check(option, path))?;
    }
    for run in &args.runs {
        if let Err(error) = args.seal.open(run) {
            eprintln!("error: {}", read_error_text(&error));
            return Ok(UNREADABLE);
        }
    }
    if args.label.len() > args.runs.len() {
        let (labels, runs) = (args.label.len(), args.runs.len());
        eprintln!("error: {labels} names are given with --label for {runs} run(s): give at most one for each");
        return Ok(UNREADABLE);
    }
    let request = Request {
        folders: &args.runs,
        labels: &args.label,
        models: &args.model,
        views: catalogue().views(),
    };
    let busy = Busy::with("reading and drawing".to_owned(), None);
    let report = match Report::read(&request) {
        Ok(report) => report,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(UNREADABLE);
        }
    };
    let page = args.out.clone();
    let page = page.unwrap_or_else(|| destination::folder_of(&args.runs[0]).join("report.html"));
    let html = report.html();
    destination::write(&page, &html).with_context(|| format!("{}: cannot write the page", page.display()))?;
    let mut files = vec![page.clone()];
    if let Some(dir) = &args.figures {
        let drawn = report.write_figures(dir)?;
        let count = drawn
            .iter()
            .filter(|file| file.extension() == Some("svg".as_ref()))
            .count();
        println!("{} ({count} figures)", dir.display());
        files.extend(drawn);
    }
    drop(busy);
    register_outputs(&files);
    println!(
        "{} ({:.1} MB, {:.2} s)",
        page.display(),
        html.len() as f64 / 1e6,
        start.elapsed().as_secs_f64()
    );
    Ok(0)
}
