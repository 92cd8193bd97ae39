//! The receiving side of a stepper: links with their schedules, and what they make of the participant's inputs.

use std::ops::Range;

use super::StepError;
use super::between::Between;
use super::source::Source;
use crate::fault::Injector;
use crate::link::{Conversion, Hold, Read, ReadSchedule};
use crate::participant::{Inputs, Payload, ValueCheck};
use crate::plan::{Assignment, Backlog, Initial, InputLink, Observed, SeenInput};
use crate::port::Descriptor;
use crate::time::{SampleTime, Ticks, Timebase};
use crate::transport::Receiver;

/// One link that feeds an input.
pub(super) struct InputState {
    /// The number of the input.
    pub(super) port: usize,
    source: Source,
    schedule: ReadSchedule,
    /// What the input shows where no sample is read.
    initial: Vec<u8>,
    shows_initial: bool,
    /// How samples become fields of the input, and the newest sample. Without one, samples are the input's payload.
    conversion: Option<(Conversion, Payload)>,
    /// The samples between which is interpolated, where that is asked for.
    between: Option<Between>,
}

impl InputState {
    pub(super) fn new(
        link: &InputLink,
        descriptor: &Descriptor,
        consumer: SampleTime,
        next: u64,
        timebase: Timebase,
        receiver: Box<dyn Receiver>,
        backlog: Vec<Backlog>,
    ) -> InputState {
        let mut schedule = ReadSchedule::new(link.visibility.clone(), consumer, link.initial == Initial::FirstSample);
        schedule.skip_to(next);
        let message = link.message(descriptor);
        InputState {
            port: link.input as usize,
            source: Source::new(link, message, timebase, receiver, backlog),
            schedule,
            initial: link.initial.payload(descriptor.size as usize),
            shows_initial: false,
            conversion: (link.conversion.clone())
                .map(|conversion| (conversion, Payload::zeroed(message.size as usize))),
            between: (link.visibility.hold() == Hold::Linear).then(|| Between::new(message, link.visibility.clone())),
        }
    }

    pub(super) fn prepare(&mut self) -> Result<(), StepError> {
        self.source.prepare()
    }

    /// What the next activation reads. To be asked once per activation.
    pub(super) fn next_read(&mut self) -> Read {
        self.schedule.advance()
    }

    /// Gets what `read` names at `t`, into `payload` if that is what the input shows; the index of a sample that is not there yet.
    pub(super) fn fetch(&mut self, read: Read, t: Ticks, payload: &mut [u8]) -> Result<Option<u64>, StepError> {
        let (Read::Sample(index) | Read::Between(index, _)) = read else {
            if !self.shows_initial && self.conversion.is_none() {
                payload.copy_from_slice(&self.initial);
            }
            self.shows_initial = true;
            return Ok(None);
        };
        let place = match &mut self.conversion {
            Some((_, sample)) => sample.bytes_mut(),
            None => payload,
        };
        if let Some(between) = &mut self.between {
            let missing = between.fetch(&mut self.source, read, t, place)?;
            self.shows_initial &= missing.is_some();
            return Ok(missing);
        }
        if self.source.is_behind(index) {
            if !self.source.receive_to(index, place)? {
                return Ok(Some(index));
            }
            self.shows_initial = false;
        }
        Ok(None)
    }
}

/// An input that is put together from what its links bring.
pub(super) struct Assembled {
    port: usize,
    /// Its links among those of all inputs.
    links: Range<usize>,
    descriptor: Descriptor,
    values: ValueCheck,
}

impl Assembled {
    /// Those of a participant.
    pub(super) fn all(assignment: &Assignment) -> Vec<Assembled> {
        let port = |link: &InputLink| link.input as usize;
        let mut assembled = Vec::new();
        let mut start = 0;
        // The links of a participant come in the order of its inputs.
        for own in assignment.inputs.chunk_by(|one, next| port(one) == port(next)) {
            let links = start..start + own.len();
            start = links.end;
            if own.iter().any(|link| link.conversion.is_some()) {
                let port = port(&own[0]);
                let descriptor = &assignment.interface.inputs[port].descriptor;
                assembled.push(Assembled {
                    port,
                    links,
                    values: ValueCheck::new(descriptor, own.iter().any(|link| link.disturbed)),
                    descriptor: descriptor.clone(),
                });
            }
        }
        assembled
    }

    /// Makes the payload out of what `links`, those of all inputs, have brought.
    pub(super) fn assemble(&self, links: &[InputState], buffers: &mut Inputs) -> Result<(), StepError> {
        let payload = buffers.payloads[self.port].bytes_mut();
        let own = &links[self.links.clone()];
        for (conversion, _) in own.iter().filter_map(|link| link.conversion.as_ref()) {
            conversion.clear(payload);
        }
        for link in own {
            match &link.conversion {
                Some((conversion, _)) if link.shows_initial => conversion.stand_in(&link.initial, payload),
                Some((conversion, sample)) => conversion.apply(sample.bytes(), payload),
                None => {}
            }
        }
        if !self.values.passes(payload) {
            let from: Vec<&str> = own.iter().map(|link| link.source.from()).collect();
            return Err(StepError::BadSample {
                from: from.join("`, `"),
                what: format!(
                    "what its connections turn into {}",
                    self.values.words(&self.descriptor, payload, "an input")
                ),
            });
        }
        Ok(())
    }
}

/// What the participant sees where that is not what came in.
pub(super) struct SeenState {
    pub(super) port: usize,
    pub(super) stream: u32,
    pub(super) observed: Observed,
    /// What came in, as long as the buffer shows what faults have made of it.
    came_in: Payload,
    pub(super) injector: Option<Injector>,
}

impl SeenState {
    pub(super) fn new(seen: &SeenInput, descriptor: &Descriptor, timebase: Timebase) -> SeenState {
        SeenState {
            port: seen.input as usize,
            stream: seen.stream,
            observed: seen.observed,
            came_in: Payload::zeroed(descriptor.size as usize),
            injector: Injector::new(&seen.faults, timebase),
        }
    }

    /// Makes `payload` what came in again. To be called before anything new comes in.
    pub(super) fn undo(&self, payload: &mut [u8]) {
        if self.injector.is_some() {
            payload.copy_from_slice(self.came_in.bytes());
        }
    }

    /// Makes of what came in what activation `k` at `t` sees. To be called once per activation.
    pub(super) fn disturb(&mut self, k: u64, t: Ticks, payload: &mut [u8]) {
        if let Some(injector) = &mut self.injector {
            self.came_in.bytes_mut().copy_from_slice(payload);
            injector.apply(k, t, payload);
        }
    }
}
