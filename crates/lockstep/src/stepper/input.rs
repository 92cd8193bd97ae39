//! The receiving side of a stepper: links with their schedules, and the assembly of the participant's inputs.

use std::ops::Range;

use super::StepError;
use super::interpolator::Interpolator;
use super::source::Source;
use crate::fault::Injector;
use crate::link::{Hold, PreparedConversion, Read, ReadSchedule};
use crate::participant::{Inputs, Payload, ValueCheck};
use crate::plan::{Assignment, InFlightSample, Initial, InputLink, Observed, SeenInput};
use crate::port::{Descriptor, Field};
use crate::time::{SampleTime, Ticks, Timebase};
use crate::transport::Receiver;

/// One link that feeds an input.
pub(super) struct InputState {
    /// The number of the input.
    pub(super) port: usize,
    source: Source,
    schedule: ReadSchedule,
    /// The read of the current activation, while its samples are missing: the schedule advances once per activation.
    due: Option<Read>,
    /// The value of the input where no sample is read.
    initial: Vec<u8>,
    shows_initial: bool,
    /// The conversion of samples to fields of the input, and the newest sample. Without one, samples are the input's payload.
    conversion: Option<(PreparedConversion, Payload)>,
    /// The interpolation between samples, if the link has it.
    interpolator: Option<Interpolator>,
}

impl InputState {
    pub(super) fn new(
        link: &InputLink,
        descriptor: &Descriptor,
        consumer: SampleTime,
        next: u64,
        timebase: Timebase,
        receiver: Box<dyn Receiver>,
        backlog: Vec<InFlightSample>,
    ) -> InputState {
        let mut schedule = ReadSchedule::new(link.delivery.clone(), consumer, link.initial == Initial::FirstSample);
        schedule.skip_to(next);
        let message = link.message(descriptor);
        InputState {
            port: link.input as usize,
            source: Source::new(link, message, timebase, receiver, backlog),
            schedule,
            due: None,
            initial: link.initial.payload(descriptor.size as usize),
            shows_initial: false,
            conversion: conversion(link, descriptor)
                .map(|conversion| (conversion, Payload::zeroed(message.size as usize))),
            interpolator: (link.delivery.hold() == Hold::Linear)
                .then(|| Interpolator::new(message, link.delivery.clone())),
        }
    }

    pub(super) fn prepare(&mut self) -> Result<(), StepError> {
        self.source.prepare()
    }

    /// Fetches what the next activation, at `t`, reads, into `payload` if that is what the input shows; returns the index of a sample that
    /// has not arrived yet, and is then to be called again.
    pub(super) fn fetch(&mut self, t: Ticks, payload: &mut [u8]) -> Result<Option<u64>, Box<StepError>> {
        let read = self.due.take().unwrap_or_else(|| self.schedule.advance());
        let missing = self.fetch_due(read, t, payload)?;
        if missing.is_some() {
            self.due = Some(read);
        }
        Ok(missing)
    }

    #[inline]
    fn fetch_due(&mut self, read: Read, t: Ticks, payload: &mut [u8]) -> Result<Option<u64>, Box<StepError>> {
        let (Read::Sample(index) | Read::Between(index, _)) = read else {
            if !self.shows_initial && self.conversion.is_none() {
                payload.copy_from_slice(&self.initial);
            }
            self.shows_initial = true;
            return Ok(None);
        };
        let target = match &mut self.conversion {
            Some((_, sample)) => sample.bytes_mut(),
            None => payload,
        };
        if let Some(interpolator) = &mut self.interpolator {
            let missing = interpolator.fetch(&mut self.source, read, t, target)?;
            self.shows_initial &= missing.is_some();
            return Ok(missing);
        }
        if self.source.is_missing(index) {
            if !self.source.receive_to(index, target)? {
                return Ok(Some(index));
            }
            self.shows_initial = false;
        }
        Ok(None)
    }
}

/// The conversion of samples of `link` to fields of an input that takes `takes`; none where the samples are the payload byte for byte,
/// even if the names differ.
fn conversion(link: &InputLink, takes: &Descriptor) -> Option<PreparedConversion> {
    let joined = PreparedConversion::new(link.conversion.as_ref()?);
    let same = joined.is_identity(link.message(takes), takes) && preserves_validity(link, &joined, takes);
    (!same).then_some(joined)
}

/// Whether valid samples of `link`, converted by `joined`, always make an input that takes `takes` valid. Enumerations that accept each
/// other's values need not have the same ones, and an interpolated value between two numbers need not be a number.
fn preserves_validity(link: &InputLink, joined: &PreparedConversion, takes: &Descriptor) -> bool {
    let number = |field: &Field| field.element.is_number();
    joined.only_copies() && link.delivery.hold() != Hold::Linear && takes.fields.iter().all(number)
}

/// An input that is assembled from the samples of its links.
pub(super) struct Assembled {
    port: usize,
    /// Its links, as a range within the links of all inputs.
    links: Range<usize>,
    descriptor: Descriptor,
    values: ValueCheck,
    /// Whether the input is valid whenever the samples of its links are, which are checked on receipt.
    preserves_validity: bool,
}

impl Assembled {
    /// The assembled inputs of a participant with the links `inputs`.
    pub(super) fn all(assignment: &Assignment, inputs: &[InputState]) -> Vec<Assembled> {
        let port = |link: &InputLink| link.input as usize;
        let mut assembled = Vec::new();
        let mut start = 0;
        // The links of a participant come in the order of its inputs.
        for own in assignment.inputs.chunk_by(|one, next| port(one) == port(next)) {
            let links = start..start + own.len();
            start = links.end;
            let states = &inputs[links.clone()];
            if states.iter().any(|link| link.conversion.is_some()) {
                let port = port(&own[0]);
                let descriptor = &assignment.interface.inputs[port].descriptor;
                let joined = own.iter().zip(states);
                let mut joined = joined.filter_map(|(link, state)| Some((link, &state.conversion.as_ref()?.0)));
                assembled.push(Assembled {
                    port,
                    links,
                    preserves_validity: joined.all(|(link, joined)| preserves_validity(link, joined, descriptor)),
                    values: ValueCheck::new(descriptor, own.iter().any(|link| link.has_faults)),
                    descriptor: descriptor.clone(),
                });
            }
        }
        assembled
    }

    /// Assembles the payload from the samples of `links`, which are those of all inputs.
    pub(super) fn assemble(&self, links: &[InputState], buffers: &mut Inputs) -> Result<(), StepError> {
        let payload = buffers.payloads[self.port].bytes_mut();
        let own = &links[self.links.clone()];
        for (conversion, _) in own.iter().filter_map(|link| link.conversion.as_ref()) {
            conversion.clear(payload);
        }
        for link in own {
            match &link.conversion {
                Some((conversion, _)) if link.shows_initial => conversion.apply_initial(&link.initial, payload),
                Some((conversion, sample)) => conversion.apply(sample.bytes(), payload),
                None => {}
            }
        }
        let good = self.preserves_validity && own.iter().all(|link| !link.shows_initial);
        if !good && !self.values.passes(payload) {
            let from: Vec<&str> = own.iter().map(|link| link.source.output_name()).collect();
            return Err(StepError::BadSample {
                from: from.join("`, `"),
                what: format!(
                    "what its connections turn into {}",
                    self.values.describe_invalid(&self.descriptor, payload, "an input")
                ),
            });
        }
        Ok(())
    }
}

/// An input at which signal faults change what the participant sees, or whose value is recorded as the participant saw it.
pub(super) struct SeenState {
    pub(super) port: usize,
    pub(super) stream: u32,
    pub(super) observed: Observed,
    /// The value before signal faults, kept while the buffer holds the value after them.
    received: Payload,
    pub(super) injector: Option<Injector>,
}

impl SeenState {
    pub(super) fn new(seen: &SeenInput, descriptor: &Descriptor, timebase: Timebase) -> SeenState {
        SeenState {
            port: seen.input as usize,
            stream: seen.stream,
            observed: seen.observed,
            received: Payload::zeroed(descriptor.size as usize),
            injector: Injector::new(&seen.faults, timebase),
        }
    }

    /// Restores `payload` to the value before signal faults. To be called before new samples are received.
    pub(super) fn remove_faults(&self, payload: &mut [u8]) {
        if self.injector.is_some() {
            payload.copy_from_slice(self.received.bytes());
        }
    }

    /// Applies signal faults to the received value, as activation `k` at `t` sees it. To be called once per activation.
    pub(super) fn inject_faults(&mut self, k: u64, t: Ticks, payload: &mut [u8]) {
        if let Some(injector) = &mut self.injector {
            self.received.bytes_mut().copy_from_slice(payload);
            injector.apply(k, t, payload);
        }
    }
}
