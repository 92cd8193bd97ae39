//! Links inside one process: a ring in memory that both ends share, with the same rules as between processes.

use std::sync::Arc;

use super::interface::{Header, Receiver, Sender, TransportError};
use super::lock_free::board::{Get, Set};
use super::lock_free::slots::{SlotReceiver, SlotSender, Slots};
use super::lock_free::words::Word;

/// The data shared by both ends.
struct Ring {
    slots: Slots,
    words: Box<[Word]>,
    taken: Taken,
}

/// How many samples the receiver has taken.
struct Taken(Word);

impl Get<u64> for Taken {
    #[inline]
    fn get(&self) -> u64 {
        self.0.load_acquire()
    }
}

impl Set<u64> for Taken {
    #[inline]
    fn set(&self, value: u64) {
        self.0.store_release(value);
    }
}

/// The sending end.
pub struct LocalSender {
    ring: Arc<Ring>,
    sender: SlotSender,
}

/// The receiving end.
pub struct LocalReceiver {
    ring: Arc<Ring>,
    receiver: SlotReceiver,
}

/// A link that holds up to `capacity` samples of `size` bytes. All of its memory is allocated here.
pub fn link(size: usize, capacity: usize) -> (LocalSender, LocalReceiver) {
    let slots = Slots::new(size, capacity);
    let ring = Arc::new(Ring {
        slots,
        words: (0..slots.words()).map(|_| Word::new(0)).collect(),
        taken: Taken(Word::new(0)),
    });
    let sender = LocalSender {
        ring: ring.clone(),
        sender: SlotSender::new(slots),
    };
    let receiver = LocalReceiver {
        ring,
        receiver: SlotReceiver::new(slots),
    };
    (sender, receiver)
}

impl Sender for LocalSender {
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, TransportError> {
        let Ring { words, taken, .. } = &*self.ring;
        self.sender.try_send(words, taken, header, payload)
    }
}

impl Receiver for LocalReceiver {
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, TransportError> {
        let Ring { slots, words, taken } = &*self.ring;
        if payload.len() != slots.size {
            let (size, expected) = (slots.size, payload.len());
            return Err(TransportError(format!(
                "a sample of {size} bytes where {expected} are expected"
            )));
        }
        self.receiver.try_receive(words, taken, payload)
    }
}
