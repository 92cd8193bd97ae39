//! Shared memory: iceoryx2, each messaging pattern for what it is for. No other module names iceoryx2.
//!
//! | need | pattern | service |
//! |---|---|---|
//! | samples on link number n | publish-subscribe and blackboard (a ring) | `link/n` |
//! | samples and notes of a participant to the recorder | publish-subscribe and blackboard (a ring) | `record/NAME` |
//! | requests to a participant | request-response | `control/NAME` |
//! | the horizon and the order to rest or leave | blackboard | `clock` |
//! | what a participant is doing, and whether it sleeps | blackboard | `status/NAME` |
//! | waking a participant | event | `wake/NAME` |

pub mod bare;
mod clock;
mod control;
mod domain;
mod footprint;
mod link;
#[cfg(test)]
#[path = "../../../tests/place/mod.rs"]
mod place;
mod record;
mod ring;
mod status;
mod wake;
mod words;

pub use clock::{ClockReader, ClockWriter, Order};
pub use control::{ControlClient, ControlServer};
pub use domain::{Address, Domain, DomainError};
pub use footprint::{Footprint, footprint};
pub use link::{LinkReceiver, LinkSender, LinkService};
pub use record::{RecordReceiver, RecordSender, Recorded, SharedRecord, record_room, unpack};
pub use status::{Activity, Sleeping, Status, StatusReader, StatusService, StatusWriter};
pub use wake::{Bell, Sleeper, WakeService, Waker};

use iceoryx2::prelude::*;

/// The version of iceoryx2 that this transport is built on; participants in other languages need the same.
pub const VERSION: &str = "0.10.0";

/// One kind of service for the whole run: every port belongs to one thread.
type Ipc = ipc::Service;

fn broken(what: impl std::fmt::Display, error: impl std::fmt::Debug) -> super::Broken {
    super::Broken(format!("{what}: {error:?}"))
}
