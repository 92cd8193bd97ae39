//! `escapement measure RUN --of FIELD --compute WHAT`: a figure of a recorded run.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::measures::{Definition, of_tape};
use engine::scenario::{DeclaredMeasure, measures_of_file, measures_of_plan};
use serde_json::json;
use tape::folder::RunFolder;
use tape::{Reader, Source, StreamSpec};
use toml::{Table, Value};

use super::seal::{SealArgs, read_error_text, warn_incomplete_records};
use crate::output;

/// Exit code: a criterion is not met.
const NOT_MET: i32 = 3;
/// Exit code: the command line, the file or the tape is wrong.
const WRONG: i32 = 2;

/// Arguments of `measure`.
#[derive(Debug, Args)]
pub struct MeasureArgs {
    /// A run folder, or its `tape` folder
    pub run: PathBuf,
    /// A field, or an element of one, such as plant.motion.position or plant.motion.velocity[2]
    #[arg(long, value_name = "FIELD", requires = "compute", conflicts_with = "measures")]
    pub of: Option<String>,
    /// A value of an enumeration: the signal is 1 where the field has this value and 0 elsewhere
    #[arg(long, value_name = "NAME", requires = "of")]
    pub is: Option<String>,
    /// Another field of the same shape, which is subtracted from the first one
    #[arg(long, value_name = "FIELD", requires = "of")]
    pub minus: Option<String>,
    /// Compute the norm of a vector, or the angle of an attitude, first: norm or angle
    #[arg(long, value_name = "HOW", requires = "of")]
    pub through: Option<String>,
    /// The figure: min, max, max-abs, mean, rms, final, at, range, integral, integral-abs, rate, time-above, time-below, first-crossing,
    /// settling-time, changes or percentile
    #[arg(long, value_name = "WHAT", requires = "of")]
    pub compute: Option<String>,
    /// The first instant of the window, such as 2s
    #[arg(long, value_name = "TIME", requires = "of")]
    pub from: Option<String>,
    /// The last instant of the window
    #[arg(long, value_name = "TIME", requires = "of")]
    pub to: Option<String>,
    /// The instant of --compute at
    #[arg(long, value_name = "TIME", requires = "of")]
    pub at: Option<String>,
    /// The threshold of time-above, time-below and first-crossing, such as "5 mm"
    #[arg(long, value_name = "VALUE", requires = "of", allow_hyphen_values = true)]
    pub threshold: Option<String>,
    /// The band of settling-time, such as "[-2, 2] mm"
    #[arg(long, value_name = "RANGE", requires = "of")]
    pub band: Option<String>,
    /// The percentage of percentile, such as 95
    #[arg(long, value_name = "NUMBER", requires = "of")]
    pub percent: Option<String>,
    /// The unit of the figure
    #[arg(long, value_name = "UNIT", requires = "of")]
    pub unit: Option<String>,
    /// The greatest value that meets the criterion, such as "5 mm"
    #[arg(long, value_name = "VALUE", requires = "of", allow_hyphen_values = true)]
    pub at_most: Option<String>,
    /// The least value that meets the criterion
    #[arg(long, value_name = "VALUE", requires = "of", allow_hyphen_values = true)]
    pub at_least: Option<String>,
    /// The range that meets the criterion, such as "[-5, 5] mm"
    #[arg(long, value_name = "RANGE", requires = "of")]
    pub within: Option<String>,
    /// The scenario file whose measures are computed
    #[arg(long, value_name = "FILE")]
    pub measures: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Whether a damaged tape is measured
    #[command(flatten)]
    pub seal: SealArgs,
}

/// Measures and prints; returns the exit code.
pub fn run(args: &MeasureArgs) -> anyhow::Result<i32> {
    let measured = args
        .seal
        .open(&args.run)
        .map_err(|error| read_error_text(&error))
        .and_then(|tape| {
            warn_incomplete_records(&tape);
            if tape.streams().is_empty() {
                return Err(format!(
                    "{}: the tape has no stream, so nothing can be measured; record a run whose [record] keeps what is to be measured",
                    args.run.display()
                ));
            }
            let definitions = args.definitions(&tape)?;
            of_tape(definitions, &tape).map_err(|error| error.to_string())
        });
    let figures = match measured {
        Ok(figures) => figures,
        Err(reason) => {
            eprintln!("error: {reason}");
            return Ok(WRONG);
        }
    };
    let mut out = output::stdout();
    if args.json {
        let mut all = figures.json();
        all.insert("verdict".into(), json!(figures.verdict()));
        serde_json::to_writer_pretty(&mut out, &all)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}", figures.text())?;
    }
    Ok(if figures.met() { 0 } else { NOT_MET })
}

impl MeasureArgs {
    fn definitions(&self, tape: &Reader) -> Result<Vec<Definition>, String> {
        let definitions = match (&self.of, &self.measures) {
            (Some(of), _) => return Ok(vec![self.single(of, tape)?]),
            (None, Some(file)) => measures_of_file(file, tape.streams()),
            (None, None) => measures_of_plan(&self.plan()?, tape.streams()),
        };
        definitions.map_err(|error| error.to_string())
    }

    /// The scenario of the run.
    fn plan(&self) -> Result<PathBuf, String> {
        let beside = self.run.parent().unwrap_or(Path::new("."));
        let plans = [&self.run, beside].map(|folder| RunFolder::open(folder).plan());
        plans.into_iter().find(|plan| plan.is_file()).ok_or_else(|| {
            format!(
                "{} has no plan.toml with measures beside its tape: say what to measure with --of and --compute, or --measures FILE",
                self.run.display()
            )
        })
    }

    /// The one measure of the command line.
    fn single(&self, of: &str, tape: &Reader) -> Result<Definition, String> {
        let mut table = Table::new();
        table.insert("of".into(), Value::String(of.to_owned()));
        for (key, text) in [
            ("is", &self.is),
            ("minus", &self.minus),
            ("through", &self.through),
            ("compute", &self.compute),
            ("from", &self.from),
            ("to", &self.to),
            ("at", &self.at),
            ("unit", &self.unit),
        ] {
            table.extend(text.iter().map(|text| (key.to_owned(), Value::String(text.clone()))));
        }
        for (key, text) in [
            ("threshold", &self.threshold),
            ("band", &self.band),
            ("percent", &self.percent),
            ("at-most", &self.at_most),
            ("at-least", &self.at_least),
            ("within", &self.within),
        ] {
            table.extend(text.iter().map(|text| (key.to_owned(), engine::scenario::value(text))));
        }
        let with_option = |(key, reason): (String, String)| match key.as_str() {
            "" => reason,
            key => format!("--{key}: {reason}"),
        };
        let name = self.compute.clone().unwrap_or_default();
        let measure = DeclaredMeasure::of_table(&name, table).map_err(with_option)?;
        let resolved = measure.resolve(tape.streams()).map_err(with_option);
        resolved.map_err(|reason| match self.missing_stream(of, tape) {
            Some(path) => format!("{reason} (`{path}` is not on the tape if [record] leaves its stream out)"),
            None => reason,
        })
    }

    /// The path of the command line whose stream the tape does not have.
    fn missing_stream<'a>(&'a self, of: &'a str, tape: &Reader) -> Option<&'a str> {
        let there = |path: &str| {
            let mut names = tape.streams().iter().map(StreamSpec::name);
            names.any(|name| path.strip_prefix(&name).is_some_and(|rest| rest.starts_with('.')))
        };
        let mut paths = std::iter::once(of).chain(self.minus.as_deref());
        paths.find(|path| !there(path))
    }
}
