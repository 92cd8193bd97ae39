//! `escapement report RUN [RUN…]`: one page about one run or several.

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use report::page::Report;

use super::trust::{Trust, told};
use crate::line::Busy;

/// Exit code: a folder is not a run, or a file of it cannot be read.
const UNREADABLE: i32 = 2;

/// Write a page with figures, summary and 3-D playback of one run or several side by side.
///
/// The page is one HTML file that needs no network and no other file.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Run folders
    #[arg(required = true)]
    pub runs: Vec<PathBuf>,
    /// Where to write the page [default: `report.html` in the first run folder]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// Also write every figure as SVG and PNG into this folder
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// A URDF for the playback, of the servicer or of the target [default: those that the run names]
    #[arg(long)]
    pub model: Vec<PathBuf>,
    /// Whether damaged tapes are reported
    #[command(flatten)]
    pub trust: Trust,
}

/// Reads the runs, writes the page and says where it is; gives the exit code.
pub fn run(args: &ReportArgs) -> anyhow::Result<i32> {
    let start = Instant::now();
    for run in &args.runs {
        if let Err(error) = args.trust.open(run) {
            eprintln!("error: {}", told(&error));
            return Ok(UNREADABLE);
        }
    }
    let busy = Busy::with("reading and drawing".to_owned(), None);
    let report = match Report::read(&args.runs, &args.model) {
        Ok(report) => report,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(UNREADABLE);
        }
    };
    let page = args.out.clone().unwrap_or_else(|| args.runs[0].join("report.html"));
    let html = report.html();
    fs::write(&page, &html).with_context(|| format!("{}: cannot write the page", page.display()))?;
    if let Some(dir) = &args.figures {
        let count = report.write_figures(dir)?;
        println!("{} ({count} figures)", dir.display());
    }
    drop(busy);
    println!(
        "{} ({:.1} MB, {:.2} s)",
        page.display(),
        html.len() as f64 / 1e6,
        start.elapsed().as_secs_f64()
    );
    Ok(0)
}
