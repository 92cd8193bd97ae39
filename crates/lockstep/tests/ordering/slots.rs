//! A link's ring: samples arrive whole, in order, once each.

use testing::loom::thread;

use crate::model::{Board, check, memory};
use crate::transport::interface::Header;
use crate::transport::lock_free::slots::{SlotReceiver, SlotSender, Slots};
use crate::transport::lock_free::sync::{Ordering, weaken};

/// The ordering that is weakened in each thread.
#[derive(Default, Clone, Copy)]
struct Weakened {
    sender: Option<Ordering>,
    receiver: Option<Ordering>,
}

fn payload_of(index: u64) -> [u8; 8] {
    (1000 + index).to_ne_bytes()
}

/// Transfers `samples` samples through a ring for `capacity` of them.
fn transfer(samples: u64, capacity: usize, weakened: Weakened) {
    check(3, move || {
        let slots = Slots::new(8, capacity);
        let (words, count) = (memory(slots.words()), Board::new(0));
        let (sender_words, sender_count) = (words.clone(), count.clone());
        let sending = thread::spawn(move || {
            weaken(weakened.sender);
            let mut sender = SlotSender::new(slots);
            for index in 0..samples {
                let header = Header {
                    index,
                    stamp: 10 * index as i64,
                };
                while !sender
                    .try_send(&sender_words, &*sender_count, header, &payload_of(index))
                    .expect("the receiver counts rightly")
                {
                    thread::yield_now();
                }
            }
        });
        weaken(weakened.receiver);
        let mut receiver = SlotReceiver::new(slots);
        for index in 0..samples {
            let mut payload = [0; 8];
            let header = loop {
                let received = receiver.try_receive(&words, &*count, &mut payload);
                if let Some(header) = received.expect("the sender numbers rightly") {
                    break header;
                }
                thread::yield_now();
            };
            assert_eq!((header.index, header.stamp), (index, 10 * index as i64));
            assert_eq!(payload, payload_of(index));
        }
        sending.join().expect("it sent everything");
    });
}

#[test]
fn slot_ring_delivers_samples_in_order_after_wrap() {
    transfer(5, 2, Weakened::default());
}

#[test]
fn slot_sender_does_not_overwrite_full_ring() {
    transfer(3, 1, Weakened::default());
}

#[test]
#[should_panic(expected = "Causality violation")]
fn slot_announcement_requires_release() {
    let sender = Some(Ordering::Release);
    transfer(
        1,
        1,
        Weakened {
            sender,
            ..Weakened::default()
        },
    );
}

#[test]
#[should_panic(expected = "Causality violation")]
fn slot_reception_requires_acquire() {
    let receiver = Some(Ordering::Acquire);
    transfer(
        1,
        1,
        Weakened {
            receiver,
            ..Weakened::default()
        },
    );
}

#[test]
#[should_panic(expected = "Causality violation")]
fn slot_count_requires_release() {
    let receiver = Some(Ordering::Release);
    transfer(
        2,
        1,
        Weakened {
            receiver,
            ..Weakened::default()
        },
    );
}

#[test]
#[should_panic(expected = "Causality violation")]
fn slot_room_check_requires_acquire() {
    let sender = Some(Ordering::Acquire);
    transfer(
        2,
        1,
        Weakened {
            sender,
            ..Weakened::default()
        },
    );
}
