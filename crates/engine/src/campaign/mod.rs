//! Campaigns: many runs of one scenario with changes, and one table of what became of them.
//!
//! A campaign is a list of points, each a list of changes as `--set` takes them. Worker processes run the points, one at a
//! time each, so that a crash of one point costs that point alone; the results go to a journal in the order in which they come
//! and into the table in the order of the points. Nothing in the table depends on the number of workers or on time.

mod analysis;
mod any_path;
mod bundle;
mod cases;
mod declared;
mod dispersions;
mod engines;
mod figures;
mod file;
mod folder;
mod grid;
mod identity;
mod journal;
mod keep;
mod merge;
mod picture;
mod plan;
mod point;
mod recall;
mod shard;
mod source;
mod spread;
mod status;
mod table;
mod tell;
mod until;
mod work;
mod worker;

use std::path::PathBuf;

pub use analysis::analysis;
pub use bundle::{Bundle, bundle};
pub use cases::{Cases, CasesError, appended, builtin, from_file as cases_from_file};
pub use declared::Declared;
pub use engines::{Cluster, Engine, Step, Waiting, submit, waiting};
pub use figures::{Figures, Number};
pub use file::CampaignFile;
pub use grid::{Axis, GridError, grid, range_of_seeds};
pub use identity::{Identity, Kind};
pub use keep::Keep;
pub use merge::merge;
pub use picture::{Picture, draw};
pub use plan::{Cell, Head, Plan, Point};
pub use point::{Outcome, Result as PointResult, figures_of};
pub use recall::Recalled;
pub use shard::{ParseShardError, Shard};
pub use source::Source;
pub use status::{Part, State, parts};
pub use table::{figure_of, figure_value, sheet, short};
pub use tell::{NORMAL_95, good_word, map, quantiles, stretches, verdicts, wilson};
pub use until::{Until, Watch};
pub use work::{Finished, Options, run, run_as};
pub use worker::serve;

use crate::run::RunFailure;
use crate::scenario::ScenarioError;

/// More points than anybody waits for, and more rows than are meant to be read.
pub const POINTS_MAX: usize = 100_000;

/// Many runs of one scenario.
#[derive(Debug)]
pub struct Campaign {
    /// Which command makes it.
    pub kind: Kind,
    /// The scenario file.
    pub scenario: PathBuf,
    /// Changes that all points share.
    pub overrides: Vec<String>,
    /// What tells the points apart, as columns of the table.
    pub columns: Vec<Column>,
    /// The changes of each point.
    pub points: Vec<Vec<String>>,
    /// Points, from 0, that there cannot be, with the reason.
    pub refused: Vec<(usize, String)>,
    /// The campaign file that declares the points, where one does.
    pub source: Option<Source>,
}

impl Campaign {
    /// All points of a plan.
    pub fn of_plan(kind: Kind, scenario: PathBuf, overrides: Vec<String>, plan: &Plan) -> Campaign {
        let (columns, settings) = plan.unrolled();
        let mut refused = Vec::new();
        let points = settings.into_iter().enumerate().map(|(k, settings)| {
            settings.unwrap_or_else(|reason| {
                refused.push((k, reason));
                Vec::new()
            })
        });
        Campaign {
            points: points.collect(),
            kind,
            scenario,
            overrides,
            columns,
            refused,
            source: None,
        }
    }

    /// What tells point `at` (from 0) apart, by column.
    pub fn values(&self, at: usize) -> serde_json::Map<String, serde_json::Value> {
        let values = self.columns.iter();
        values.map(|column| (column.name.clone(), column.json(at))).collect()
    }

    /// The campaign with its first `count` points alone.
    #[must_use]
    pub fn first(&self, count: usize) -> Campaign {
        Campaign {
            kind: self.kind,
            scenario: self.scenario.clone(),
            overrides: self.overrides.clone(),
            columns: self.columns.iter().map(|column| column.first(count)).collect(),
            points: self.points.iter().take(count).cloned().collect(),
            refused: self.refused.iter().filter(|(at, _)| *at < count).cloned().collect(),
            source: self.source.clone(),
        }
    }
}

/// A column that tells points apart.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// The unit of its numbers; empty where it has none.
    pub unit: String,
    /// The value of each point as text.
    pub texts: Vec<String>,
    /// The same as numbers, where all of them are numbers of that unit.
    pub numbers: Option<Vec<f64>>,
    /// The same where all of them are whole numbers without a unit, such as seeds, which a double cannot always hold.
    pub whole: Option<Vec<i64>>,
}

impl Column {
    /// A column of words.
    pub fn of_texts(name: &str, texts: Vec<String>) -> Column {
        Column {
            name: name.to_owned(),
            unit: String::new(),
            texts,
            numbers: None,
            whole: None,
        }
    }

    fn first(&self, count: usize) -> Column {
        fn some<T: Clone>(all: &[T], count: usize) -> Vec<T> {
            all.iter().take(count).cloned().collect()
        }
        Column {
            name: self.name.clone(),
            unit: self.unit.clone(),
            texts: some(&self.texts, count),
            numbers: self.numbers.as_ref().map(|all| some(all, count)),
            whole: self.whole.as_ref().map(|all| some(all, count)),
        }
    }

    /// Whether all are whole numbers, of which some are too large for 64 bits with a sign.
    fn beyond_whole(&self) -> bool {
        let digits = |text: &String| {
            text.strip_prefix('-')
                .unwrap_or(text)
                .bytes()
                .all(|letter| letter.is_ascii_digit())
        };
        self.whole.is_none() && self.numbers.is_some() && self.unit.is_empty() && self.texts.iter().all(digits)
    }

    /// The value of a point as JSON: a number where it is one that a reader gets exactly.
    pub fn json(&self, point: usize) -> serde_json::Value {
        match (&self.whole, &self.numbers) {
            (Some(whole), _) => serde_json::json!(whole[point]),
            (None, Some(numbers)) if !self.beyond_whole() => serde_json::json!(numbers[point]),
            (None, _) => serde_json::json!(self.texts[point]),
        }
    }
}

/// Why there is no campaign, or no more of it.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The scenario, or the first point of it, is wrong.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The list of cases is wrong.
    #[error(transparent)]
    Cases(#[from] CasesError),
    /// What shall be varied makes no sense.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A number of points that there cannot be.
    #[error("--points: {0}")]
    Points(String),
    /// The folder belongs to something else.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why it is not taken.
        reason: String,
    },
    /// Folders of shards do not make a whole.
    #[error("{0}")]
    Merge(String),
    /// The engine is not there, or does not do it.
    #[error("--on {engine}: {reason}")]
    Engine {
        /// Which one.
        engine: &'static str,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// The figure is not there.
    #[error("there is no figure of merit `{name}`; there is {known}")]
    Figure {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// The scenario has changed under the campaign.
    #[error("{} has changed since the campaign began: start it again", path.display())]
    Changed {
        /// The scenario.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The table cannot be written.
    #[error(transparent)]
    Export(#[from] report::export::ExportError),
    /// A run cannot be started.
    #[error(transparent)]
    Run(#[from] RunFailure),
}

impl CampaignError {
    /// The exit code of the program: 2 when the user must change something, else 1.
    pub fn exit_code(&self) -> i32 {
        match self {
            CampaignError::Io { .. }
            | CampaignError::Export(_)
            | CampaignError::Changed { .. }
            | CampaignError::Engine { .. } => 1,
            CampaignError::Run(failure) => failure.exit_code(),
            _ => 2,
        }
    }
}
