//! Shared memory by iceoryx2, with one messaging pattern for each purpose. No other module names iceoryx2.
//!
//! | need | pattern | service |
//! |---|---|---|
//! | samples on link number n | publish-subscribe and blackboard (a ring) | `link/n` |
//! | samples and events of a participant to the recorder | publish-subscribe and blackboard (a ring) | `record/NAME` |
//! | requests to a participant | request-response | `control/NAME` |
//! | the horizon and the command to run, pause or terminate | blackboard | `clock` |
//! | what a participant is doing, and whether it sleeps | blackboard | `status/NAME` |
//! | waking a participant | event | `wake/NAME` |

pub mod bare;
mod clock;
mod control;
mod domain;
mod footprint;
mod ipc;
mod link;
mod record;
mod ring;
mod status;
#[cfg(test)]
#[path = "../../../tests/test_domain/mod.rs"]
mod test_domain;
mod wake;

pub use crate::transport::lock_free::clock::Command;
pub use crate::transport::lock_free::entries::{Recorded, record_ring_bytes, unpack};
pub use crate::transport::lock_free::wait_reason::WaitReason;
pub use clock::{ClockReader, ClockWriter};
pub use control::{ControlClient, ControlServer, PendingRequest};
pub use domain::{Address, Domain, DomainError};
pub use footprint::{Footprint, footprint};
pub use ipc::VERSION;
pub use link::{LinkReceiver, LinkSender, LinkService};
pub use record::{RecordReceiver, RecordSender, SharedRecord};
pub use status::{Activity, Status, StatusReader, StatusService, StatusWriter};
pub use wake::{Sleeper, WakeNotifier, WakeService, Waker};
