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
mod text;
mod time;
mod whole;
mod write;

pub use changes::Changes;
pub use connection::{ConnectionSpec, Frames};
pub use entries::Entries;
pub use fault::{FaultKind, FaultSpec, State};
pub use guard::GuardSpec;
pub use measure::{MeasureKind, MeasureSpec, ThroughKind};
pub(super) use origin::Origin;
pub use participant::{OnFailureSpec, ParticipantSpec};
pub(super) use read::{Measured, Reading, measured};
pub(super) use record::SEEN;
pub use record::{RecordPart, RecordSpec};
pub use run::RunSpec;
pub use time::Time;
pub(super) use whole::FOLDER;
pub use whole::ScenarioSpec;
