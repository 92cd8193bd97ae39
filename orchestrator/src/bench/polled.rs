//! The minimum that the machine itself takes for an exchange of 27 doubles each way: two threads on two cores that poll memory.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use super::cores::{cores, pin_thread_to};

/// Doubles of a payload.
const DOUBLES: usize = 27;

/// Nanoseconds per exchange over two cells, each a payload guarded by a counter: the cost of moving cache lines.
pub(super) fn cells(exchanges: u64) -> f64 {
    struct Cell {
        count: AtomicU64,
        values: [AtomicU64; DOUBLES],
    }
    let make = || Cell {
        count: AtomicU64::new(0),
        values: [const { AtomicU64::new(0) }; DOUBLES],
    };
    let cells = &[make(), make()];
    let put = |cell: &Cell, round: u64| {
        fill(&cell.values, round);
        cell.count.store(round, Ordering::Release);
    };
    let take = |cell: &Cell, round: u64| {
        poll_until(|| cell.count.load(Ordering::Acquire) == round);
        sum(&cell.values)
    };
    ping_pong(
        exchanges,
        |end, round| put(&cells[end], round),
        |end, round| take(&cells[end], round),
    )
}

/// Nanoseconds per exchange over two rings of slots as SimBricks has them between its simulators: a word at the end of each slot names its
/// owner, and each side polls for its own slots. Nothing is checked or recorded.
pub(super) fn rings(exchanges: u64) -> f64 {
    const SLOTS: usize = 8;
    /// Four cache lines.
    #[repr(align(64))]
    struct Slot {
        values: [AtomicU64; DOUBLES],
        stamp: AtomicU64,
        _space: [u64; 3],
        /// 0: the sender's; 1: the receiver's.
        owner: AtomicU64,
    }
    let slot = || Slot {
        values: [const { AtomicU64::new(0) }; DOUBLES],
        stamp: AtomicU64::new(0),
        _space: [0; 3],
        owner: AtomicU64::new(0),
    };
    let rings = &[(); 2].map(|()| [(); SLOTS].map(|()| slot()));
    let at = |end: usize, round: u64| &rings[end][round as usize % SLOTS];
    let put = |end: usize, round: u64| {
        let slot = at(end, round);
        poll_until(|| slot.owner.load(Ordering::Acquire) == 0);
        fill(&slot.values, round);
        slot.stamp.store(round, Ordering::Relaxed);
        slot.owner.store(1, Ordering::Release);
    };
    let take = |end: usize, round: u64| {
        let slot = at(end, round);
        poll_until(|| slot.owner.load(Ordering::Acquire) == 1);
        let all = sum(&slot.values) + slot.stamp.load(Ordering::Relaxed);
        slot.owner.store(0, Ordering::Release);
        all
    };
    ping_pong(exchanges, put, take)
}

fn fill(values: &[AtomicU64], value: u64) {
    values.iter().for_each(|cell| cell.store(value, Ordering::Relaxed));
}

fn sum(values: &[AtomicU64]) -> u64 {
    values.iter().map(|cell| cell.load(Ordering::Relaxed)).sum()
}

/// Polls until `condition` holds; on one core, the other thread runs in between.
fn poll_until(condition: impl Fn() -> bool) {
    while !condition() {
        std::hint::spin_loop();
        if cores_are_shared() {
            rustix::thread::sched_yield();
        }
    }
}

fn cores_are_shared() -> bool {
    static SHARED: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
    *SHARED.get_or_init(|| cores().len() < 2)
}

/// Two threads, each on a core: the first sends on way 0 and hears on way 1, the second answers. Returns nanoseconds per exchange.
fn ping_pong(exchanges: u64, put: impl Fn(usize, u64) + Sync, take: impl Fn(usize, u64) -> u64 + Sync) -> f64 {
    // Asked before a thread is tied to one core.
    cores_are_shared();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            pin_thread_to(0);
            for round in 1..=exchanges {
                std::hint::black_box(take(0, round));
                put(1, round);
            }
        });
        let timed = scope.spawn(|| {
            pin_thread_to(1);
            let started = Instant::now();
            for round in 1..=exchanges {
                put(0, round);
                std::hint::black_box(take(1, round));
            }
            started.elapsed().as_nanos() as f64 / exchanges as f64
        });
        timed.join().unwrap_or(f64::NAN)
    })
}
