//! A scenario as a value: the content of a file, which can be created, changed and written in code.

mod change;
mod changes;
mod connection;
mod edit;
mod entries;
mod fault;
mod fault_text;
mod files;
mod guard;
mod measure;
mod origin;
mod participant;
mod read;
mod record;
mod run;
mod scenario_spec;
mod text;
mod time;
mod write;

pub use changes::Changes;
pub use connection::{ConnectionSpec, Frames};
pub use entries::Entries;
pub use fault::{FaultKind, FaultSpec, State};
pub use guard::GuardSpec;
pub use measure::{MeasureKind, MeasureSpec, ThroughKind};
pub(super) use origin::Origin;
pub use participant::{OnFailureSpec, ParticipantSpec};
pub(super) use read::{MeasureTables, PartialScenario, read_measures};
pub(super) use record::SEEN;
pub use record::{RecordPart, RecordSpec};
pub use run::RunSpec;
pub(super) use scenario_spec::FOLDER;
pub use scenario_spec::ScenarioSpec;
pub use time::Time;
