//! Transports of samples between participants: one small interface, one file for each implementation.

pub mod iceoryx;
pub(crate) mod interface;
pub mod local;
pub(crate) mod lock_free;

pub use interface::{Header, NoRecording, Receiver, Recording, Sender, TransportError};
