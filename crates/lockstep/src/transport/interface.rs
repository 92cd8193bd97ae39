//! The two ends of a link and the recording: what every transport implements.

use crate::time::Ticks;

/// The other end is gone, or violated the protocol of the transport itself.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TransportError(pub String);

/// The header of every sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Header {
    /// The index of the sample in its output's sequence.
    pub index: u64,
    /// Its stamp, ticks of the plan.
    pub stamp: Ticks,
}

/// The sending end of a link: first in, first out, without loss or repetition.
pub trait Sender {
    /// To be called before the first sample, when the other end is present: allocates what the link needs, so that sending a sample does
    /// not.
    fn prepare(&mut self) -> Result<(), TransportError> {
        Ok(())
    }

    /// Sends one sample, or does nothing and returns `false` when there is no room now.
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, TransportError>;
}

/// The receiving end of a link.
pub trait Receiver {
    /// To be called before the first sample, when the other end is present: allocates what the link needs, so that receiving a sample
    /// does not.
    fn prepare(&mut self) -> Result<(), TransportError> {
        Ok(())
    }

    /// Copies the next sample into `payload`, or returns `None` when there is none yet. A sample of another size than `payload` is an
    /// error: it comes from a participant that violates its own description.
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, TransportError>;
}

/// The recording: a participant appends every sample of every output to it, for the tape.
pub trait Recording {
    /// Appends one sample, or does nothing and returns `false` when there is no room now.
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, TransportError>;

    /// The samples appended since the last call are one complete activation. From now on they reach the recorder even if the
    /// participant's process is killed at the next instruction: they may be sent to other participants.
    fn commit(&mut self) {}
}

/// A recording that discards everything.
#[derive(Debug, Default, Clone, Copy)]
pub struct NoRecording;

impl Recording for NoRecording {
    fn try_append(&mut self, _: u32, _: Header, _: &[u8]) -> Result<bool, TransportError> {
        Ok(true)
    }
}
