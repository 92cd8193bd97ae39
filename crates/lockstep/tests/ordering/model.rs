//! What the tests share: a bounded search, a board, an event, memory.

use std::time::Duration;

use testing::loom::sync::{Arc, Condvar, Mutex};

use crate::transport::interface::TransportError;
use crate::transport::lock_free::board::{Get, Set};
use crate::transport::lock_free::sync::{AtomicU64, Ordering};
use crate::transport::lock_free::wait_reason::{SetWaitReason, Sleep, WaitReason, set_wait_reason};
use crate::transport::lock_free::words::Word;

/// Runs `body` in every order with at most `preemptions` switches away from a thread that could have gone on. Two are known to show nearly
/// all mistakes of such protocols; every lacking ordering below is found with them.
pub(crate) fn check(preemptions: usize, body: impl Fn() + Sync + Send + 'static) {
    let mut builder = testing::loom::model::Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.check(body);
}

/// Memory of `words` words that several threads see.
pub(crate) fn memory(words: usize) -> Arc<Vec<Word>> {
    Arc::new((0..words).map(|_| Word::new(0)).collect())
}

/// A blackboard's entry.
pub(crate) struct Board(AtomicU64);

impl Board {
    pub(crate) fn new(value: u64) -> Arc<Board> {
        Arc::new(Board(AtomicU64::new(value)))
    }
}

impl Get<u64> for Board {
    fn get(&self) -> u64 {
        self.0.load(Ordering::Acquire)
    }
}

impl Set<u64> for Board {
    fn set(&self, value: u64) {
        self.0.store(value, Ordering::Release);
    }
}

impl Get<i64> for Board {
    fn get(&self) -> i64 {
        self.0.load(Ordering::Acquire) as i64
    }
}

impl Set<i64> for Board {
    fn set(&self, value: i64) {
        self.0.store(value as u64, Ordering::Release);
    }
}

/// A participant's *wait reason* word.
pub(crate) struct WaitReasonWord(pub(crate) Arc<Board>);

impl SetWaitReason for WaitReasonWord {
    fn set_wait_reason(&mut self, what: Option<WaitReason>) {
        set_wait_reason(&*self.0, what);
    }
}

/// An event. No thread wakes up spontaneously, so a lost wake-up is a deadlock, which the model checker reports.
#[derive(Clone)]
pub(crate) struct Event(Arc<(Mutex<bool>, Condvar)>);

impl Event {
    pub(crate) fn new() -> Event {
        Event(Arc::new((Mutex::new(false), Condvar::new())))
    }

    pub(crate) fn notify(&self) {
        *self.0.0.lock().expect("no thread panics") = true;
        self.0.1.notify_one();
    }
}

impl Sleep for Event {
    fn sleep(&mut self, _limit: Duration) -> Result<(), TransportError> {
        let (notified, condition) = &*self.0;
        let mut notified = notified.lock().expect("no thread panics");
        while !*notified {
            notified = condition.wait(notified).expect("no thread panics");
        }
        *notified = false;
        Ok(())
    }
}
