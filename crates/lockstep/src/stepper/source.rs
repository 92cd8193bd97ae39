//! Receiving the samples of a link; every sample is checked.

use std::collections::VecDeque;

use super::StepError;
use crate::participant::ValueCheck;
use crate::plan::{InFlightSample, InputLink};
use crate::port::Descriptor;
use crate::time::{SampleTime, Timebase};
use crate::transport::{Header, Receiver, TransportError};

pub(super) struct Source {
    receiver: Box<dyn Receiver>,
    from: String,
    descriptor: Descriptor,
    values: ValueCheck,
    producer: SampleTime,
    timebase: Timebase,
    /// The newest sample received: each sample arrives once, in order.
    received: Option<u64>,
    /// Samples that were sent before this participant took over, oldest first.
    backlog: VecDeque<InFlightSample>,
}

impl Source {
    pub(super) fn new(
        link: &InputLink,
        message: &Descriptor,
        timebase: Timebase,
        receiver: Box<dyn Receiver>,
        backlog: Vec<InFlightSample>,
    ) -> Source {
        Source {
            receiver,
            from: link.from.clone(),
            values: ValueCheck::new(message, link.has_faults),
            descriptor: message.clone(),
            producer: link.delivery.producer(),
            timebase,
            received: None,
            backlog: backlog.into(),
        }
    }

    /// The name of the output.
    pub(super) fn output_name(&self) -> &str {
        &self.from
    }

    pub(super) fn prepare(&mut self) -> Result<(), StepError> {
        self.receiver.prepare().map_err(|source| self.link_error(source))
    }

    fn link_error(&self, source: TransportError) -> StepError {
        StepError::Broken {
            way: format!("from `{}`", self.from),
            source,
        }
    }

    /// Whether sample `index` has not been received yet.
    pub(super) fn is_missing(&self, index: u64) -> bool {
        self.received.is_none_or(|received| received < index)
    }

    /// Receives samples into `payload` up to `index`; returns whether that one has arrived.
    pub(super) fn receive_to(&mut self, index: u64, payload: &mut [u8]) -> Result<bool, Box<StepError>> {
        while self.is_missing(index) {
            let received = self.receive(payload).map_err(|source| self.link_error(source))?;
            let Some(header) = received else { return Ok(false) };
            self.check(header, index, payload)?;
            self.received = Some(header.index);
        }
        Ok(true)
    }

    /// The next sample: first those sent before this participant took over, then those of the link.
    fn receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, TransportError> {
        let Some(sample) = self.backlog.pop_front() else {
            return self.receiver.try_receive(payload);
        };
        if sample.payload.len() != payload.len() {
            let (received_size, expected) = (sample.payload.len(), payload.len());
            return Err(TransportError(format!(
                "a sample of {received_size} bytes where {expected} are expected"
            )));
        }
        payload.copy_from_slice(&sample.payload);
        Ok(Some(Header {
            index: sample.index,
            stamp: self.producer.instant(sample.index),
        }))
    }

    /// Checks a sample. A producer may send samples that no consumer reads; it must not repeat, reorder or omit samples, and must give
    /// the true stamp of each.
    fn check(&self, header: Header, wanted: u64, payload: &[u8]) -> Result<(), Box<StepError>> {
        let violation = |what: String| {
            Err(Box::new(StepError::BadSample {
                from: self.from.clone(),
                what,
            }))
        };
        if let Some(received) = self.received.filter(|&received| header.index <= received) {
            return violation(format!(
                "sample #{} after sample #{received}: samples come once each, in order",
                header.index
            ));
        }
        if header.index > wanted {
            return violation(format!(
                "sample #{} where #{wanted} is due: a sample was left out",
                header.index
            ));
        }
        let expected = self.producer.instant(header.index);
        if header.stamp != expected {
            return violation(format!(
                "sample #{} stamped t = {} s; its stamp must be {} s",
                header.index,
                self.timebase.seconds(header.stamp),
                self.timebase.seconds(expected)
            ));
        }
        if !self.values.passes(payload) {
            let words = self.values.describe_invalid(&self.descriptor, payload, "a sample");
            return violation(format!("sample #{} with {words}", header.index));
        }
        Ok(())
    }
}
