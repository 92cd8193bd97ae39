//! The sending side of a stepper.

use super::StepError;
use crate::fault::Injector;
use crate::link::ReadSchedule;
use crate::participant::{Payload, ValueCheck};
use crate::plan::{Consumer, Observed, OutputPort};
use crate::port::Descriptor;
use crate::time::{Ticks, Timebase};
use crate::transport::{Header, Sender, TransportError};

pub(super) struct OutputState {
    pub(super) stream: u32,
    pub(super) observed: Observed,
    /// Whether the current sample is recorded, and whether it is seen.
    pub(super) recorded: bool,
    pub(super) seen: bool,
    pub(super) name: String,
    pub(super) descriptor: Descriptor,
    pub(super) values: ValueCheck,
    pub(super) consumers: Vec<ConsumerState>,
    pub(super) fault_injection: Option<FaultInjection>,
    /// The number of consumers that the current sample has been sent to, or that do not read it.
    pub(super) consumers_done: usize,
}

/// The sample sent to consumers after signal faults have been applied.
pub(super) struct FaultInjection {
    pub(super) injector: Injector,
    payload: Payload,
}

impl FaultInjection {
    pub(super) fn new(injector: Injector, size: usize) -> FaultInjection {
        FaultInjection {
            injector,
            payload: Payload::zeroed(size),
        }
    }
}

impl OutputState {
    /// For an output with the name and the descriptor of its port; `first_stamp` is the stamp of its next sample, `None` when that is its
    /// first.
    pub(super) fn new(
        output: &OutputPort,
        name: &str,
        descriptor: &Descriptor,
        senders: Vec<Box<dyn Sender>>,
        timebase: Timebase,
        first_stamp: Option<Ticks>,
    ) -> OutputState {
        let consumers = senders.into_iter().zip(&output.consumers);
        OutputState {
            stream: output.stream,
            observed: output.observed,
            recorded: true,
            seen: true,
            name: name.to_owned(),
            values: ValueCheck::new(descriptor, false),
            descriptor: descriptor.clone(),
            consumers: consumers
                .map(|(sender, consumer)| ConsumerState::new(consumer, sender, first_stamp))
                .collect(),
            fault_injection: Injector::new(&output.faults, timebase)
                .map(|injector| FaultInjection::new(injector, descriptor.size as usize)),
            consumers_done: 0,
        }
    }

    /// Determines whether sample `index`, the current one from now on, is seen.
    pub(super) fn update_seen(&mut self, index: u64) {
        let mut read = false;
        for consumer in &mut self.consumers {
            read |= consumer.update_seen(index);
        }
        self.recorded = self.observed.contains(index);
        // A fault may depend on earlier samples.
        self.seen = self.recorded || read || self.fault_injection.is_some();
    }

    /// Whether any sample of the run is seen.
    pub(super) fn is_ever_seen(&self) -> bool {
        !self.observed.is_empty() || !self.consumers.is_empty() || self.fault_injection.is_some()
    }

    /// The bytes of the current sample for the recorder: none when it is not observed.
    pub(super) fn record<'a>(&self, sample: &'a Payload) -> &'a [u8] {
        if self.recorded { sample.bytes() } else { &[] }
    }

    /// Applies signal faults to sample `header`, which is on the tape, for its consumers. To be called once for each sample.
    pub(super) fn inject_faults(&mut self, header: Header, sample: &[u8]) {
        if let Some(FaultInjection { injector, payload }) = &mut self.fault_injection {
            payload.bytes_mut().copy_from_slice(sample);
            injector.apply(header.index, header.stamp, payload.bytes_mut());
        }
    }

    /// Sends the sample, after signal faults, to the consumers that read it; returns the one for which there is no room, and is then to be
    /// called again.
    pub(super) fn publish(&mut self, header: Header, sample: &[u8]) -> Result<Option<usize>, Box<StepError>> {
        let injection = self.fault_injection.as_ref();
        let payload = injection.map_or(sample, |injection| injection.payload.bytes());
        let consumers = self.consumers.iter_mut().enumerate().skip(self.consumers_done);
        for (number, consumer) in consumers.filter(|(_, consumer)| consumer.reads_current) {
            match consumer.sender.try_send(header, payload) {
                Ok(true) => {}
                Ok(false) => {
                    self.consumers_done = number;
                    return Ok(Some(number));
                }
                Err(source) => return Err(Box::new(consumer.link_error(source))),
            }
        }
        self.consumers_done = 0;
        Ok(None)
    }

    pub(super) fn prepare(&mut self) -> Result<(), StepError> {
        self.consumers.iter_mut().try_for_each(|consumer| {
            let prepared = consumer.sender.prepare();
            prepared.map_err(|source| consumer.link_error(source))
        })
    }
}

pub(super) struct ConsumerState {
    pub(super) sender: Box<dyn Sender>,
    pub(super) to: String,
    /// Whether the consumer reads the current sample.
    pub(super) reads_current: bool,
    schedule: ReadSchedule,
    /// Activations of the consumer before the end.
    activations: u64,
    /// The next sample that the consumer reads, as far as known, and the one that it reads together with it.
    next_read: Option<u64>,
    next_read_pair: Option<u64>,
}

impl ConsumerState {
    /// For a producer whose next sample is stamped `from`; `None` when that is its first.
    pub(super) fn new(consumer: &Consumer, sender: Box<dyn Sender>, from: Option<Ticks>) -> ConsumerState {
        let mut schedule = consumer.schedule();
        if let Some(from) = from {
            // No consumer reads a sample before its stamp, so the reads before it can be skipped.
            schedule.skip_to(consumer.sample_time.count_before(from));
        }
        ConsumerState {
            sender,
            to: consumer.to.clone(),
            reads_current: false,
            schedule,
            activations: consumer.sample_time.count_before(consumer.end),
            next_read: None,
            next_read_pair: None,
        }
    }

    fn link_error(&self, source: TransportError) -> StepError {
        StepError::Broken {
            way: format!("to `{}`", self.to),
            source,
        }
    }

    /// Determines whether any activation reads sample `index`; to be called with rising indices.
    fn update_seen(&mut self, index: u64) -> bool {
        self.reads_current = loop {
            match self.next_read {
                Some(next) if next >= index => break next == index,
                _ if self.next_read_pair.is_some() => self.next_read = self.next_read_pair.take(),
                _ if self.schedule.next_activation() >= self.activations => break false,
                _ => {
                    let mut samples = self.schedule.advance().samples();
                    self.next_read = samples.next().or(self.next_read);
                    self.next_read_pair = samples.next();
                }
            }
        };
        self.reads_current
    }
}
