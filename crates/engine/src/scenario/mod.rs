//! Scenario files: reading them and resolving their content.

mod entry;
mod error;
mod failure;
mod faults;
mod fields;
mod fit;
mod guards;
mod initial;
mod lines;
mod make;
mod measures;
mod names;
mod paths;
mod pictures;
mod plan;
mod ports;
mod program;
mod recorded;
mod resolve;
mod run_table;
mod source;
mod spec;
mod symbols;
mod value;

pub use entry::Entry;
pub use error::{Mistake, ScenarioError};
pub use failure::OnFailure;
pub(crate) use initial::{hexadecimal, payload};
pub(crate) use lines::Lines;
pub use measures::{DeclaredMeasure, measures_of_file, measures_of_plan};
pub use names::{ORCHESTRATOR, fault_name};
pub(crate) use paths::{Named, each_in, each_named};
pub(crate) use ports::port_of;
pub use program::{Program, in_path};
pub use resolve::Scenario;
pub use spec::{
    Changes, ConnectionSpec, Entries, FaultKind, FaultSpec, Frames, GuardSpec, MeasureKind, MeasureSpec, OnFailureSpec,
    ParticipantSpec, RecordPart, RecordSpec, RunSpec, ScenarioSpec, State, ThroughKind, Time,
};
pub use value::value;
