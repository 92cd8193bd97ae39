//! Sleep and wake-up: no participant stays asleep while what it waits for is there.

use testing::loom::sync::Arc;
use testing::loom::thread;

use crate::backoff::Backoff;
use crate::control::WaitStrategy;
use crate::model::{Board, Event, WaitReasonWord, check, memory};
use crate::transport::interface::Header;
use crate::transport::lock_free::slots::{SlotReceiver, SlotSender, Slots};
use crate::transport::lock_free::sync::{Ordering, weaken};
use crate::transport::lock_free::wait_reason::{WaitReason, must_be_woken};
use crate::transport::lock_free::words::Word;

const SLOTS: Slots = Slots::new(8, 1);

/// One end of a link, with its wait reason, its event and those of the other end.
struct End {
    words: Arc<Vec<Word>>,
    count: Arc<Board>,
    backoff: Backoff,
    own: WaitReasonWord,
    event: Event,
    other: Arc<Board>,
    notifier: Event,
}

impl End {
    /// Repeats `attempt` until it succeeds, and sleeps in between: no spinning, no yielding.
    fn until<T>(&mut self, what: WaitReason, mut attempt: impl FnMut(&[Word], &Board) -> Option<T>) -> T {
        loop {
            if let Some(done) = attempt(&self.words, &self.count) {
                self.backoff.reset(&mut self.own);
                return done;
            }
            let slept = self.backoff.pause(what, &mut self.own, &mut self.event);
            slept.expect("an event");
        }
    }

    fn wake(&self, occurred: WaitReason) {
        if must_be_woken(&*self.other, |what| what == occurred) {
            self.notifier.notify();
        }
    }
}

/// The sending and the receiving end of one link.
fn ends() -> [End; 2] {
    let (words, count) = (memory(SLOTS.words()), Board::new(0));
    let wait_reasons = [Board::new(0), Board::new(0)];
    let events = [Event::new(), Event::new()];
    [0, 1].map(|own| End {
        words: words.clone(),
        count: count.clone(),
        backoff: Backoff::new(WaitStrategy { spins: 0, yields: 0 }),
        own: WaitReasonWord(wait_reasons[own].clone()),
        event: events[own].clone(),
        other: wait_reasons[1 - own].clone(),
        notifier: events[1 - own].clone(),
    })
}

fn send(end: &mut End, sender: &mut SlotSender, index: u64) {
    let header = Header { index, stamp: 0 };
    end.until(WaitReason::for_room(0), |words, count| {
        let sent = sender.try_send(words, count, header, &[7; 8]);
        sent.expect("the receiver counts rightly").then_some(())
    });
}

fn receive(end: &mut End, receiver: &mut SlotReceiver) -> u64 {
    let header = end.until(WaitReason::for_sample(0), |words, count| {
        let received = receiver.try_receive(words, count, &mut [0; 8]);
        received.expect("the sender numbers rightly")
    });
    header.index
}

/// Sends `samples` through a ring for one; each end sleeps when it has to wait.
fn send_sleeping(samples: u64, weakened: [Option<Ordering>; 2]) {
    check(3, move || {
        let [mut sending, mut receiving] = ends();
        let thread = thread::spawn(move || {
            weaken(weakened[0]);
            let mut sender = SlotSender::new(SLOTS);
            for index in 0..samples {
                send(&mut sending, &mut sender, index);
                sending.wake(WaitReason::for_sample(0));
            }
        });
        weaken(weakened[1]);
        let mut receiver = SlotReceiver::new(SLOTS);
        for index in 0..samples {
            assert_eq!(receive(&mut receiving, &mut receiver), index);
            receiving.wake(WaitReason::for_room(0));
        }
        thread.join().expect("it sent everything");
    });
}

#[test]
fn sleeper_misses_no_wake_up_in_either_direction() {
    send_sleeping(3, [None, None]);
}

#[test]
#[should_panic(expected = "deadlock")]
fn waker_requires_fence() {
    send_sleeping(1, [Some(Ordering::SeqCst), None]);
}

#[test]
#[should_panic(expected = "deadlock")]
fn sleeper_requires_fence() {
    send_sleeping(1, [None, Some(Ordering::SeqCst)]);
}

/// The sender dies between its store and the wake-up. `noticed`: the orchestrator wakes the receiver.
fn die_before_wake_up(noticed: bool) {
    check(3, move || {
        let [mut sending, mut receiving] = ends();
        let notifier = sending.notifier.clone();
        let dying = thread::spawn(move || send(&mut sending, &mut SlotSender::new(SLOTS), 5));
        let orchestrator = thread::spawn(move || {
            dying.join().expect("the thread does not panic");
            if noticed {
                notifier.notify();
            }
        });
        assert_eq!(receive(&mut receiving, &mut SlotReceiver::new(SLOTS)), 5);
        orchestrator.join().expect("the orchestrator does not panic");
    });
}

#[test]
fn receiver_wakes_when_sender_death_is_noticed() {
    die_before_wake_up(true);
}

/// The reason for the longest sleep of [`Backoff`]: nothing else ends the sleep before the death is noticed.
#[test]
#[should_panic(expected = "deadlock")]
fn receiver_sleeps_until_sender_death_is_noticed() {
    die_before_wake_up(false);
}
