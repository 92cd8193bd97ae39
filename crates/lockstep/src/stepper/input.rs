//! The receiving side of a stepper: nothing that comes in is trusted.

use std::collections::VecDeque;

use super::StepError;
use crate::fault::Injector;
use crate::link::{Read, ReadSchedule};
use crate::participant::{FiniteCheck, Payload, first_not_finite};
use crate::plan::{Backlog, Initial, InputLink};
use crate::port::Descriptor;
use crate::time::{SampleTime, Ticks, Timebase};
use crate::transport::{Broken, Header, Receiver};

pub(super) struct InputState {
    receiver: Box<dyn Receiver>,
    schedule: ReadSchedule,
    from: String,
    descriptor: Descriptor,
    finite: FiniteCheck,
    initial: Vec<u8>,
    producer: SampleTime,
    timebase: Timebase,
    /// The newest sample received: samples come in order, once each. It is the one in the buffer, unless `shows_initial`.
    received: Option<u64>,
    shows_initial: bool,
    /// Samples that were sent before this participant took over, oldest first.
    backlog: VecDeque<Backlog>,
    /// Whether a fault on the way may have made samples NaN or infinite.
    disturbed: bool,
    pub(super) seen: Option<SeenState>,
}

/// What the participant sees where that is not what came in.
pub(super) struct SeenState {
    pub(super) stream: u32,
    /// What came in, as long as the buffer shows what faults have made of it.
    came_in: Payload,
    injector: Option<Injector>,
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
        InputState {
            receiver,
            schedule,
            backlog: backlog.into(),
            from: link.from.clone(),
            finite: FiniteCheck::new(descriptor),
            initial: match &link.initial {
                Initial::Value(bytes) => bytes.clone(),
                Initial::FirstSample => vec![0; descriptor.size as usize],
            },
            descriptor: descriptor.clone(),
            producer: link.visibility.producer(),
            timebase,
            received: None,
            shows_initial: false,
            disturbed: link.disturbed,
            seen: link.seen.map(|stream| SeenState {
                stream,
                came_in: Payload::zeroed(descriptor.size as usize),
                injector: Injector::new(&link.faults, timebase),
            }),
        }
    }

    pub(super) fn injector(&mut self) -> Option<&mut Injector> {
        self.seen.as_mut()?.injector.as_mut()
    }

    pub(super) fn prepare(&mut self) -> Result<(), StepError> {
        self.receiver.prepare().map_err(|source| self.broken(source))
    }

    fn broken(&self, source: Broken) -> StepError {
        StepError::Broken {
            way: format!("from `{}`", self.from),
            source,
        }
    }

    /// What the next activation reads. To be asked once per activation; `payload` becomes what came in again.
    pub(super) fn next_read(&mut self, payload: &mut [u8]) -> Read {
        if let Some(SeenState {
            came_in,
            injector: Some(_),
            ..
        }) = &self.seen
        {
            payload.copy_from_slice(came_in.bytes());
        }
        self.schedule.advance()
    }

    /// Makes of what came in what activation `k` at `t` sees. To be called once per activation.
    pub(super) fn disturb(&mut self, k: u64, t: Ticks, payload: &mut [u8]) {
        if let Some(SeenState {
            came_in,
            injector: Some(injector),
            ..
        }) = &mut self.seen
        {
            came_in.bytes_mut().copy_from_slice(payload);
            injector.apply(k, t, payload);
        }
    }

    /// Brings the sample that `read` names into `payload`; `Some(index)` when it is not there yet.
    pub(super) fn fetch(&mut self, read: Read, payload: &mut [u8]) -> Result<Option<u64>, StepError> {
        let Read::Sample(index) = read else {
            if !self.shows_initial {
                payload.copy_from_slice(&self.initial);
                self.shows_initial = true;
            }
            return Ok(None);
        };
        while self.received.is_none_or(|received| received < index) {
            let received = self.receive(payload).map_err(|source| self.broken(source))?;
            let Some(header) = received else { return Ok(Some(index)) };
            self.check(header, index, payload)?;
            self.received = Some(header.index);
            self.shows_initial = false;
        }
        Ok(None)
    }

    /// The next sample: first what was sent before this participant took over, then what comes.
    fn receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        let Some(sample) = self.backlog.pop_front() else {
            return self.receiver.try_receive(payload);
        };
        if sample.payload.len() != payload.len() {
            let (came, due) = (sample.payload.len(), payload.len());
            return Err(Broken(format!("a sample of {came} bytes where {due} are expected")));
        }
        payload.copy_from_slice(&sample.payload);
        Ok(Some(Header {
            index: sample.index,
            stamp: self.producer.instant(sample.index),
        }))
    }

    /// A producer may send samples that nobody reads; it must not repeat, reorder or leave out, and it must not lie about
    /// when a sample was taken.
    fn check(&self, header: Header, wanted: u64, payload: &[u8]) -> Result<(), StepError> {
        let bad = |what: String| {
            Err(StepError::BadSample {
                from: self.from.clone(),
                what,
            })
        };
        if let Some(received) = self.received.filter(|&received| header.index <= received) {
            return bad(format!(
                "sample #{} after sample #{received}: samples come once each, in order",
                header.index
            ));
        }
        if header.index > wanted {
            return bad(format!(
                "sample #{} where #{wanted} is due: a sample was left out",
                header.index
            ));
        }
        let due = self.producer.instant(header.index);
        if header.stamp != due {
            return bad(format!(
                "sample #{} stamped t = {} s; its stamp must be {} s",
                header.index,
                self.timebase.seconds(header.stamp),
                self.timebase.seconds(due)
            ));
        }
        if !self.disturbed && !self.finite.passes(payload) {
            let (element, value) = first_not_finite(&self.descriptor, payload).unwrap_or_default();
            return bad(format!(
                "sample #{} with {element} = {value}: a sample must be finite",
                header.index
            ));
        }
        Ok(())
    }
}
