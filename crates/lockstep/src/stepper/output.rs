//! The sending side of a stepper.

use crate::link::{Read, ReadSchedule};
use crate::participant::FiniteCheck;
use crate::plan::Consumer;
use crate::port::Descriptor;
use crate::transport::Sender;

pub(super) struct OutputState {
    pub(super) stream: u32,
    pub(super) name: String,
    pub(super) descriptor: Descriptor,
    pub(super) finite: FiniteCheck,
    pub(super) consumers: Vec<ConsumerState>,
}

pub(super) struct ConsumerState {
    pub(super) sender: Box<dyn Sender>,
    pub(super) to: String,
    /// Whether it reads the sample in work.
    pub(super) wants: bool,
    schedule: ReadSchedule,
    /// Activations of the consumer before the end.
    activations: u64,
    /// The next sample that it reads, as far as known.
    next_read: Option<u64>,
}

impl ConsumerState {
    pub(super) fn new(consumer: &Consumer, sender: Box<dyn Sender>) -> ConsumerState {
        ConsumerState {
            sender,
            to: consumer.to.clone(),
            wants: false,
            schedule: consumer.schedule(),
            activations: consumer.sample_time.count_before(consumer.end),
            next_read: None,
        }
    }

    /// Notes whether any activation reads sample `index`; to be called with rising indices.
    pub(super) fn look_at(&mut self, index: u64) -> bool {
        self.wants = loop {
            match self.next_read {
                Some(next) if next >= index => break next == index,
                _ if self.schedule.next_activation() >= self.activations => break false,
                _ => {
                    if let Read::Sample(next) = self.schedule.advance() {
                        self.next_read = Some(next);
                    }
                }
            }
        };
        self.wants
    }
}
