//! Receivers of samples.

use super::AppendError;

/// A receiver of samples: the [`Writer`](super::Writer) on disk, a [`MemoryTape`](super::MemoryTape), or a
/// [`DigestSink`](super::DigestSink) when only the identity of the result matters.
pub trait Sink {
    /// Takes sample `index` of stream number `stream` (the position in the list the sink was created with), stamped `stamp_s` seconds.
    /// Samples of one stream come in the order of their index, without gaps; streams may interleave in any way. Does not allocate.
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError>;
}

impl<S: Sink + ?Sized> Sink for &mut S {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        (**self).sample(stream, index, stamp_s, payload)
    }
}
