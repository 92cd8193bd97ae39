//! The receiving side of a stepper: nothing that comes in is trusted.

use super::StepError;
use crate::link::{Read, ReadSchedule};
use crate::participant::{FiniteCheck, first_not_finite};
use crate::plan::{Initial, InputLink};
use crate::port::Descriptor;
use crate::time::{SampleTime, Timebase};
use crate::transport::{Header, Receiver};

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
}

impl InputState {
    pub(super) fn new(
        link: &InputLink,
        descriptor: &Descriptor,
        consumer: SampleTime,
        timebase: Timebase,
        receiver: Box<dyn Receiver>,
    ) -> InputState {
        let first_sample = link.initial == Initial::FirstSample;
        InputState {
            receiver,
            schedule: ReadSchedule::new(link.visibility, consumer, first_sample),
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
        }
    }

    /// What the next activation reads. To be asked once per activation.
    pub(super) fn next_read(&mut self) -> Read {
        self.schedule.advance()
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
            let received = self.receiver.try_receive(payload).map_err(|source| StepError::Broken {
                way: format!("from `{}`", self.from),
                source,
            })?;
            let Some(header) = received else { return Ok(Some(index)) };
            self.check(header, index, payload)?;
            self.received = Some(header.index);
            self.shows_initial = false;
        }
        Ok(None)
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
        if !self.finite.passes(payload) {
            let (element, value) = first_not_finite(&self.descriptor, payload).unwrap_or_default();
            return bad(format!(
                "sample #{} with {element} = {value}: a sample must be finite",
                header.index
            ));
        }
        Ok(())
    }
}
