//! The horizon and the command to all participants: two numbers that all processes read at any time and only the orchestrator writes.

use super::board::{Get, Set};
use crate::time::Ticks;

/// The command to run, which is the initial value on the board.
pub(crate) const RUN: u64 = 0;
const TERMINATE: u64 = 1;
const PAUSE: u64 = 2;

/// The command to all participants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Step up to the horizon.
    Run,
    /// Pause at the current activation, and wait for requests.
    Pause,
    /// Terminate, or enter the run again at the address of the last request to move.
    Terminate,
}

/// The command to all participants. An unknown command counts as the command to terminate.
pub(crate) fn command(board: &impl Get<u64>) -> Command {
    match board.get() {
        RUN => Command::Run,
        PAUSE => Command::Pause,
        _ => Command::Terminate,
    }
}

/// Sets the command to all participants.
pub(crate) fn set_command(board: &impl Set<u64>, command: Command) {
    board.set(match command {
        Command::Run => RUN,
        Command::Pause => PAUSE,
        Command::Terminate => TERMINATE,
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
