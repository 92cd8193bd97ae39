//! The plan: everything about a run that can be computed before anything runs.
//!
//! Which sample every activation reads, the order of activations at one instant, how far producers may run ahead, and which participants
//! can work at the same time. A plan is plain data; the executors, the hosts and the recorder all work from the same one.

mod assignment;
mod build;
mod capacity;
mod components;
mod cut;
mod error;
mod faults;
mod fields;
mod limits;
mod network;
mod observed;
mod order;
mod placement;

pub use assignment::{Assignment, Consumer, InputLink, OutputPort, SeenInput};
pub use build::{LinkSpec, ParticipantSpec};
pub use cut::{Cut, InFlightSample, Position, StuckValues};
pub use error::{DelayPart, PlanError};
pub use limits::PARTICIPANTS_MAX;
pub use network::{Initial, Link, Participant, Plan, Seen};
pub use observed::Observed;
pub use placement::{Placement, place, place_separately};
