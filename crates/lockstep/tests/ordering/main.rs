//! Memory ordering of the transport: hand-over, wrap-around, full rings, wake-up, death.
//!
//! The files under test are those of the transport itself, compiled here a second time with the atomics of a model checker (loom). It
//! explores the interleavings of two or three threads, and the values that a weakly ordered processor may let them read. Each test of a
//! protocol has counterparts that weaken one ordering and must fail: so every ordering is necessary.
//!
//! iceoryx2 is modelled by its guarantees: a blackboard publishes with a release and is read with an acquire, and a notification before
//! its listener sleeps wakes the listener.

#![allow(dead_code, reason = "the files under test have more in them than these tests call")]

mod control {
    pub use lockstep::control::{ParticipantEvent, WaitStrategy};
}
mod time {
    pub use lockstep::time::Ticks;
}
mod wire {
    pub use lockstep::wire::{decode, encode};
}
mod transport {
    pub mod interface {
        pub use lockstep::transport::{Header, TransportError};
    }
    pub(crate) use crate::lock_free;
}
#[path = "../../src/host/backoff.rs"]
mod backoff;

mod clock;
mod entries;
mod lock_free;
mod model;
mod slots;
mod wake;
