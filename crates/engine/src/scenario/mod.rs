//! Scenario files: reading them and resolving their content.

mod entry;
mod error;
mod failure;
mod faults;
mod fields;
mod file_references;
mod guards;
mod initial;
mod key_lines;
mod make;
mod measures;
mod names;
mod plan;
mod port_checks;
mod ports;
mod program;
mod recorded;
mod report_view;
mod resolve;
mod run_table;
mod source;
mod spec;
mod symbols;
mod value;

pub use entry::Entry;
pub use error::{Mistake, ScenarioError};
pub use failure::OnFailure;
pub(crate) use file_references::{FileReference, visit_file_references, visit_file_references_at};
pub(crate) use initial::{hexadecimal, payload};
pub(crate) use key_lines::KeyLines;
pub use measures::{DeclaredMeasure, measures_of_file, measures_of_plan};
pub use names::{ORCHESTRATOR, fault_name, find_entry};
pub(crate) use ports::port_of;
pub use program::{Program, in_path};
pub use resolve::Scenario;
pub use spec::{
    Changes, ConnectionSpec, Entries, FaultKind, FaultSpec, Frames, GuardSpec, MeasureKind, MeasureSpec, OnFailureSpec,
    ParticipantSpec, RecordPart, RecordSpec, RunSpec, ScenarioSpec, State, ThroughKind, Time,
};
pub use value::value;
