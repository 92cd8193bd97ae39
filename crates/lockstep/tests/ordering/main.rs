//! Memory ordering of the transport: hand-over, wrap-around, full rings, wake-up, death.
//!
//! The files under test are those of the transport itself, compiled here a second time with the atomics of a model checker (loom). It goes
//! through the orders in which two or three threads can meet, and through the values that a weakly ordered processor may show them.
//! Each test of a protocol stands beside tests that take one ordering away and see it fail: so none is there for nothing.
//!
//! What iceoryx2 brings is modelled by its promise: a blackboard publishes with a release and is read with an acquire, and an event that
//! is rung before its listener sleeps wakes it.

#![allow(dead_code, reason = "the files under test have more in them than these tests call")]

mod control {
    pub use lockstep::control::{ParticipantEvent, Waiting};
}
mod time {
    pub use lockstep::time::Ticks;
}
mod wire {
    pub use lockstep::wire::{decode, encode};
}
mod transport {
    pub mod interface {
        pub use lockstep::transport::{Broken, Header};
    }
    pub(crate) use crate::lock_free;
}
#[path = "../../src/host/waiting.rs"]
mod waiting;

mod clock;
mod entries;
mod lock_free;
mod model;
mod slots;
mod wake;
