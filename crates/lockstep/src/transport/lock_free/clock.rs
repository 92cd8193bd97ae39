//! The horizon and what everybody is to do: two numbers that everyone reads at any time and only the orchestrator writes.

use super::board::{Get, Set};
use crate::time::Ticks;

/// The order to go on, as it stands on the board at first.
pub(crate) const GO_ON: u64 = 0;
const LEAVE: u64 = 1;
const REST: u64 = 2;

/// What everybody is to do besides stepping up to the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Nothing else.
    GoOn,
    /// Come to rest wherever you are, and wait for requests.
    Rest,
    /// Leave.
    Leave,
}

/// What everybody is to do. An order that is not known is one to leave.
pub(crate) fn order(board: &impl Get<u64>) -> Order {
    match board.get() {
        GO_ON => Order::GoOn,
        REST => Order::Rest,
        _ => Order::Leave,
    }
}

/// Tells everybody what to do.
pub(crate) fn give(board: &impl Set<u64>, order: Order) {
    board.set(match order {
        Order::GoOn => GO_ON,
        Order::Rest => REST,
        Order::Leave => LEAVE,
    });
}

/// The horizon as the orchestrator knows it: it only goes forward.
pub(crate) struct Horizon {
    now: Ticks,
}

impl Horizon {
    /// Before all instants: nobody does anything.
    pub(crate) const START: Horizon = Horizon { now: Ticks::MIN };

    pub(crate) fn now(&self) -> Ticks {
        self.now
    }

    /// Moves it to `horizon` if that is ahead.
    pub(crate) fn extend(&mut self, board: &impl Set<Ticks>, horizon: Ticks) {
        if horizon > self.now {
            self.now = horizon;
            board.set(horizon);
        }
    }
}
