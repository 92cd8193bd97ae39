//! Campaigns: many runs of one scenario with changes, and one table of their results.
//!
//! A campaign is a list of points; each point is a list of changes as `--set` takes them. Worker processes run the points,
//! several side by side where the participants support it. When a worker crashes, the points that it was running are run
//! again one by one, so that only the point that crashes is lost. The results go to a journal in order of arrival, and into
//! the table in the order of the points. Nothing in the table depends on the number of workers, on lanes or on time.
//!
//! # Example
//!
//! Two delays and three seeds are six points. [`run()`] runs them in worker processes. A worker is this program once more, so its `main` must
//! call [`serve`] there.
//!
//! ```
//! use engine::campaign::{Axis, Campaign, CampaignKind, Plan, grid};
//! use engine::scenario::Changes;
//!
//! let axes: Vec<Axis> = vec!["connections.level.delay=5ms,10ms".parse()?, "seed=1..3".parse()?];
//! let (columns, points) = grid(&axes)?;
//! let plan = Plan::Listed { columns, points };
//! let campaign = Campaign::of_plan(CampaignKind::Sweep, "tank.toml".into(), Changes::default(), &plan);
//! assert_eq!(campaign.points.len(), 6);
//! assert_eq!(campaign.points[5], ["connections.level.delay=10 ms", "seed=3"]);
//! # Ok::<(), engine::campaign::GridError>(())
//! ```

mod analysis;
mod cases;
mod cell;
mod chart;
mod column;
mod declared;
mod definition;
mod dispersions;
mod engines;
mod error;
mod figures;
mod file;
mod folder;
mod grid;
mod options;
mod plan;
mod rare;
mod shards;
mod source;
mod stopping_rule;
mod summary;
mod workers;

pub use analysis::{analysis, of_cases};
pub use cases::{Cases, CasesError, appended, builtin, from_file as cases_from_file, locate_in_first_case};
pub use cell::{Cell, Head, Point};
pub use chart::content::ChartContent;
pub use chart::draw::draw_chart;
pub use column::{Column, POINTS_MAX};
pub use declared::Declared;
pub use definition::{Campaign, CampaignKind};
pub use engines::{Cluster, Engine, Step, SubmittedShards, Waiting, submit, waiting};
pub use error::CampaignError;
pub use figures::{Figures, Number};
pub use file::CampaignFile;
pub use folder::identity::Identity;
pub use folder::keep::Keep;
pub use folder::recall::StoredPoint;
pub use folder::status::{Part, State, parts, unassigned_points};
pub use folder::table::{figure_of, figure_value, sheet};
pub use grid::{Axis, GridError, grid, range_of_seeds};
pub use options::Options;
pub use plan::Plan;
pub use rare::{Rare, RareEventResult};
pub use sampling::statistics::wilson;
pub use shards::bundle::{Bundle, bundle};
pub use shards::merge::{AuditCoverage, Merged, merge};
pub use shards::shard::{ParseShardError, Shard};
pub use source::Source;
pub use stopping_rule::{Until, Watch};
pub use summary::{map, met_ranges, quantiles, success_name, verdicts};
pub use workers::point::{Outcome, Result as PointResult, figures_of, outcome_name};
pub use workers::pool::{Finished, run, run_as};
pub use workers::worker::serve;
