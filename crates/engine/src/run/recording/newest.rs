//! The newest samples of a run that is driven from code.

use lockstep::participant::Payload;
use lockstep::port::{Descriptor, Message};
use lockstep::transport::Header;
use tape::StreamSpec;

use crate::run::outcome::RunFailure;

/// The newest sample of each stream.
pub(crate) struct NewestSamples(Vec<(Option<Header>, Payload)>);

impl NewestSamples {
    /// For `streams`, without any sample yet.
    pub(crate) fn new(streams: &[StreamSpec]) -> NewestSamples {
        let sizes = streams.iter().map(|spec| spec.descriptor.size as usize);
        NewestSamples(sizes.map(|size| (None, Payload::zeroed(size))).collect())
    }

    /// Discards all samples.
    pub(crate) fn clear(&mut self) {
        self.0.iter_mut().for_each(|(header, _)| *header = None);
    }

    pub(crate) fn put(&mut self, stream: usize, header: Header, payload: &[u8]) {
        let (newest, bytes) = &mut self.0[stream];
        *newest = Some(header);
        bytes.bytes_mut().copy_from_slice(payload);
    }

    pub(crate) fn get(&self, stream: usize) -> Option<(Header, &Payload)> {
        let (header, payload) = self.0.get(stream)?;
        Some(((*header)?, payload))
    }
}

/// A sample of a port, with its name, descriptor, index and stamp.
#[derive(Debug, Clone)]
pub struct Sample {
    pub(crate) name: String,
    pub(crate) descriptor: Descriptor,
    pub(crate) index: u64,
    pub(crate) stamp_s: f64,
    pub(crate) payload: Payload,
}

impl Sample {
    /// `PARTICIPANT.PORT`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its fields with types, shapes, units and frames.
    pub fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }

    /// Its index in the sequence of its port, from 0.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Its stamp, s.
    pub fn stamp_s(&self) -> f64 {
        self.stamp_s
    }

    /// The payload as it was published.
    pub fn bytes(&self) -> &[u8] {
        self.payload.bytes()
    }

    /// The payload as the message `M`.
    ///
    /// # Errors
    /// When the port's payload has other fields than `M`.
    pub fn get<M: Message>(&self) -> Result<M, RunFailure> {
        match M::descriptor().difference(&self.descriptor) {
            None => Ok(self.payload.get()),
            Some(difference) => Err(RunFailure::Port {
                port: self.name.clone(),
                reason: format!("its payload is no `{}`: {difference}", M::descriptor().name),
            }),
        }
    }

    /// The elements of the field called `name` as doubles, row-major, in the field's unit.
    ///
    /// # Errors
    /// When there is no such field.
    pub fn field(&self, name: &str) -> Result<Vec<f64>, RunFailure> {
        let field = self.descriptor.field(name).ok_or_else(|| RunFailure::Port {
            port: self.name.clone(),
            reason: no_field(&self.descriptor, name),
        })?;
        let payload = self.payload.bytes();
        Ok((0..field.len()).map(|at| field.value(payload, at)).collect())
    }
}

/// The message that `descriptor` has no field `name`, with the fields that it has.
pub(crate) fn no_field(descriptor: &Descriptor, name: &str) -> String {
    let known: Vec<String> = descriptor
        .fields
        .iter()
        .map(|field| format!("`{}`", field.name))
        .collect();
    format!("its payload has no field `{name}`; it has {}", known.join(", "))
}
