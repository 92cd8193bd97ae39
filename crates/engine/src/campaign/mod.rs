//! Campaigns: many runs of one scenario with changes, and one table of their results.
//!
//! A campaign is a list of points; each point is a list of changes as `--set` takes them. Worker processes run the points,
//! several side by side where the participants support it. When a worker crashes, the points that it was running are run
//! again one by one, so that only the point that crashes is lost. The results go to a journal in order of arrival, and into
//! the table in the order of the points. Nothing in the table depends on the number of workers, on lanes or on time.

mod abreast;
mod analysis;
mod any_path;
mod bundle;
mod cases;
mod cell;
mod column;
mod company;
mod declared;
mod definition;
mod dispersions;
mod drawn;
mod engines;
mod error;
mod figures;
mod file;
mod folder;
mod grid;
mod identity;
mod journal;
mod keep;
mod merge;
mod options;
mod over_one;
mod over_two;
mod picture;
mod plan;
mod point;
mod rare;
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

pub use analysis::{analysis, of_cases};
pub use bundle::{Bundle, bundle};
pub use cases::{Cases, CasesError, appended, builtin, from_file as cases_from_file};
pub use cell::{Cell, Head, Point};
pub use column::{Column, POINTS_MAX};
pub use declared::Declared;
pub use definition::{Campaign, Kind};
pub use drawn::draw;
pub use engines::{Cluster, Engine, Step, Underway, Waiting, submit, waiting};
pub use error::CampaignError;
pub use figures::{Figures, Number};
pub use file::CampaignFile;
pub use grid::{Axis, GridError, grid, range_of_seeds};
pub use identity::Identity;
pub use keep::Keep;
pub use merge::merge;
pub use options::Options;
pub use picture::Picture;
pub use plan::Plan;
pub use point::{Outcome, Result as PointResult, figures_of, word};
pub use rare::{Rare, Rarely};
pub use recall::Recalled;
pub use sampling::statistics::wilson;
pub use shard::{ParseShardError, Shard};
pub use source::Source;
pub use status::{Part, State, parts};
pub use table::{figure_of, figure_value, sheet, short};
pub use tell::{good_word, map, quantiles, stretches, verdicts};
pub use until::{Until, Watch};
pub use work::{Finished, run, run_as};
pub use worker::serve;
