//! The two ends of a link and the way to the tape: what every transport implements.

use crate::time::Ticks;

/// The other end is gone, or broke the rules of the transport itself.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Broken(pub String);

/// What travels in front of every sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Header {
    /// The index of the sample in its output's sequence.
    pub index: u64,
    /// Its stamp, ticks of the plan.
    pub stamp: Ticks,
}

/// The sending end of a link: first in, first out, nothing is ever lost or repeated.
pub trait Sender {
    /// To be called before the first sample, when the other end is there: takes what the link needs, so that no sample has to.
    fn prepare(&mut self) -> Result<(), Broken> {
        Ok(())
    }

    /// Sends one sample, or does nothing and answers `false` when there is no room now.
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken>;
}

/// The receiving end of a link.
pub trait Receiver {
    /// To be called before the first sample, when the other end is there: takes what the link needs, so that no sample has to.
    fn prepare(&mut self) -> Result<(), Broken> {
        Ok(())
    }

    /// Copies the next sample into `payload`, or answers `None` when there is none yet. A sample of another size than
    /// `payload` is an error: it comes from a participant that does not keep to its own description.
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken>;
}

/// Where a participant puts every sample of every output for the tape.
pub trait Recording {
    /// Puts one sample, or does nothing and answers `false` when there is no room now.
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> Result<bool, Broken>;

    /// The samples put since the last call are one activation, all of it. From now on they reach the recorder even if the
    /// participant's process is killed at the next instruction: other participants may be shown them.
    fn commit(&mut self) {}
}

/// A recording that keeps nothing.
#[derive(Debug, Default, Clone, Copy)]
pub struct NoRecording;

impl Recording for NoRecording {
    fn try_append(&mut self, _: u32, _: Header, _: &[u8]) -> Result<bool, Broken> {
        Ok(true)
    }
}
