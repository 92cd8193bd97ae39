//! A record's ring: whole activations, in order; the recorder has every sample before another participant can see it.

use testing::loom::thread;

use crate::model::{Board, check, memory};
use crate::transport::interface::{Header, TransportError};
use crate::transport::lock_free::entries::{EntryReceiver, EntrySender, Recorded};
use crate::transport::lock_free::slots::{SlotReceiver, SlotSender, Slots};
use crate::transport::lock_free::sync::{Ordering, weaken};
use crate::transport::lock_free::words::{LINE, Word};

/// Words of the ring: an activation of two samples is 10 words, so the second one continues at the ring's beginning.
const SIZE: usize = 16;

fn sender() -> EntrySender {
    EntrySender::new(SIZE, 0, &[8, 8])
}

fn header(index: u64) -> Header {
    Header {
        index,
        stamp: 10 * index as i64,
    }
}

/// Appends sample `index` of `stream`; returns whether there was room.
fn append(sender: &mut EntrySender, words: &[Word], count: &Board, stream: u32, index: u64) -> bool {
    let payload = (100 * u64::from(stream) + index).to_ne_bytes();
    let appended = sender.try_append_sample(words, count, stream, header(index), &payload);
    appended.expect("the recorder counts rightly")
}

/// Receives the samples after the first `known` ones; returns the new total.
fn receive(receiver: &mut EntryReceiver, words: &[Word], count: &Board, known: u64) -> u64 {
    let mut samples = known;
    let received = receiver.receive(words, count, |entry| {
        let Recorded::Sample {
            stream,
            header: found,
            payload,
        } = entry
        else {
            panic!("there are no events");
        };
        let (due, index) = (samples % 2, samples / 2);
        assert_eq!((u64::from(stream), found), (due, header(index)));
        assert_eq!(payload, (100 * due + index).to_ne_bytes());
        samples += 1;
        Ok::<(), TransportError>(())
    });
    received.expect("the participant commits rightly");
    samples
}

/// Records `activations`, each with a sample of two streams.
fn record(activations: u64, weakened: [Option<Ordering>; 2]) {
    check(3, move || {
        let (words, count) = (memory(LINE + SIZE), Board::new(0));
        let (participant_words, recorder_count) = (words.clone(), count.clone());
        let recording = thread::spawn(move || {
            weaken(weakened[0]);
            let mut sender = sender();
            for index in 0..activations {
                for stream in [0, 1] {
                    while !append(&mut sender, &participant_words, &recorder_count, stream, index) {
                        assert_eq!(stream, 0, "room for the first is room for all");
                        thread::yield_now();
                    }
                }
                sender.commit(&participant_words);
            }
        });
        weaken(weakened[1]);
        let (mut receiver, mut samples) = (EntryReceiver::new(), 0);
        while samples < 2 * activations {
            samples = receive(&mut receiver, &words, &count, samples);
            assert!(samples.is_multiple_of(2), "whole activations");
            thread::yield_now();
        }
        recording.join().expect("it recorded everything");
    });
}

#[test]
fn record_delivers_whole_activations_in_order_after_wrap() {
    record(3, [None, None]);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn record_commit_requires_release() {
    record(1, [Some(Ordering::Release), None]);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn record_commit_read_requires_acquire() {
    record(1, [None, Some(Ordering::Acquire)]);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn entry_count_requires_release() {
    record(2, [None, Some(Ordering::Release)]);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn entry_room_check_requires_acquire() {
    record(2, [Some(Ordering::Acquire), None]);
}

#[test]
fn sender_death_in_activation_leaves_whole_activations() {
    check(3, || {
        let (words, count) = (memory(LINE + 2 * SIZE), Board::new(0));
        let (participant_words, recorder_count) = (words.clone(), count.clone());
        let dying = thread::spawn(move || {
            let mut sender = EntrySender::new(2 * SIZE, 0, &[8, 8]);
            for (stream, index) in [(0, 0), (1, 0), (0, 1)] {
                assert!(append(&mut sender, &participant_words, &recorder_count, stream, index));
                if stream == 1 {
                    sender.commit(&participant_words);
                }
            }
        });
        let mut receiver = EntryReceiver::new();
        let before = receive(&mut receiver, &words, &count, 0);
        assert!(before == 0 || before == 2, "{before}");
        dying.join().expect("the thread does not panic");
        assert_eq!(receive(&mut receiver, &words, &count, before), 2);
        assert_eq!(receive(&mut receiver, &words, &count, 2), 2);
    });
}

/// A participant records a sample, then sends it to a neighbour; once the neighbour has it, the record must contain it.
fn record_then_send(weakened: Option<Ordering>) {
    check(3, move || {
        let slots = Slots::new(8, 1);
        let (record, recorded) = (memory(LINE + SIZE), Board::new(0));
        let (link, taken) = (memory(slots.words()), Board::new(0));
        let participant = {
            let (record, recorded) = (record.clone(), recorded.clone());
            let (link, taken) = (link.clone(), taken.clone());
            thread::spawn(move || {
                weaken(weakened);
                let mut sender = sender();
                for stream in [0, 1] {
                    assert!(append(&mut sender, &record, &recorded, stream, 0));
                }
                sender.commit(&record);
                let sent = SlotSender::new(slots).try_send(&link, &*taken, header(0), &[7; 8]);
                assert_eq!(sent, Ok(true));
            })
        };
        let neighbour = thread::spawn(move || {
            let received = SlotReceiver::new(slots).try_receive(&link, &*taken, &mut [0; 8]);
            received.expect("the sender numbers rightly").is_some()
        });
        if neighbour.join().expect("the neighbour does not panic") {
            let samples = receive(&mut EntryReceiver::new(), &record, &recorded, 0);
            assert_eq!(samples, 2, "the recorder lacks what others have seen");
        }
        participant.join().expect("the participant does not panic");
    });
}

#[test]
fn sample_seen_by_neighbour_is_in_record() {
    record_then_send(None);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn sample_after_commit_requires_release() {
    record_then_send(Some(Ordering::Release));
}
