//! The horizon and the order to all participants: two numbers that all processes read at any time and only the orchestrator writes.

use super::board::{Get, Set};
use crate::time::Ticks;

/// The order to go on, which is the initial value on the board.
pub(crate) const GO_ON: u64 = 0;
const LEAVE: u64 = 1;
const REST: u64 = 2;

/// The order to all participants, besides stepping up to the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Nothing else.
    GoOn,
    /// Come to rest at the current activation, and wait for requests.
    Rest,
    /// Leave.
    Leave,
}

/// The order to all participants. An unknown order counts as the order to leave.
pub(crate) fn order(board: &impl Get<u64>) -> Order {
    match board.get() {
        GO_ON => Order::GoOn,
        REST => Order::Rest,
        _ => Order::Leave,
    }
}

/// Gives an order to all participants.
pub(crate) fn give(board: &impl Set<u64>, order: Order) {
    board.set(match order {
        Order::GoOn => GO_ON,
        Order::Rest => REST,
        Order::Leave => LEAVE,
    });
}

/// The horizon as the orchestrator knows it; it only moves forward.
pub(crate) struct Horizon {
    now: Ticks,
}

impl Horizon {
    /// Before all instants: no participant does anything.
    pub(crate) const START: Horizon = Horizon { now: Ticks::MIN };

    pub(crate) fn now(&self) -> Ticks {
        self.now
    }

    /// Moves the horizon to `horizon` if that is later.
    pub(crate) fn extend(&mut self, board: &impl Set<Ticks>, horizon: Ticks) {
        if horizon > self.now {
            self.now = horizon;
            board.set(horizon);
        }
    }
}
