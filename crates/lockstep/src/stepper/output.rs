//! The sending side of a stepper.

use crate::link::{Read, ReadSchedule};
use crate::participant::FiniteCheck;
use crate::plan::Consumer;
use crate::port::Descriptor;
use crate::time::Ticks;
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
    /// For a producer whose next sample is the one stamped `from`; `None` when that is its first.
    pub(super) fn new(consumer: &Consumer, sender: Box<dyn Sender>, from: Option<Ticks>) -> ConsumerState {
        let mut schedule = consumer.schedule();
        if let Some(from) = from {
            // Nobody reads a sample before its stamp, so the reads before it need not be gone through.
            schedule.skip_to(consumer.sample_time.count_before(from));
        }
        ConsumerState {
            sender,
            to: consumer.to.clone(),
            wants: false,
            schedule,
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
