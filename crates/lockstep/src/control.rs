//! The control protocol: messages between the orchestrator and a participant outside the data path.

use serde::{Deserialize, Serialize};

use crate::participant::Interface;
use crate::plan::{Assignment, Position};
use crate::span::Span;

/// The version of the protocol. Both sides must have the same.
pub const PROTOCOL: u32 = 7;

/// From the orchestrator to a participant; each is answered by one [`Reply`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Asks the participant for its protocol version and its program.
    Hello {
        /// The orchestrator's [`PROTOCOL`].
        protocol: u32,
    },
    /// Passes the parameters; the participant replies with its ports.
    Configure {
        /// The participant's name in the scenario.
        name: String,
        /// The parameters as a TOML document, with the contents of files in place of their names.
        parameters: String,
        /// The seed of the run.
        seed: u64,
        /// The sample period, s.
        period: f64,
        /// The first activation, s.
        offset: f64,
    },
    /// Passes the part of the plan; the participant opens its links and prepares. Nothing is published before the horizon moves.
    Connect {
        /// The part of the plan.
        assignment: Assignment,
        /// The cores to run on; empty leaves the choice to the operating system.
        cores: Vec<u32>,
        /// The waiting strategy.
        waiting: WaitStrategy,
        /// The size of the record's ring, bytes: a multiple of 64.
        record: u32,
        /// The position to resume at; `None` at the start of a run.
        position: Option<Box<Position>>,
    },
    /// Requests the state. Only while the participant is paused.
    Save,
    /// Leave all links and enter the run again at this address, with the model as it is. Only while paused. Without an address: another
    /// participant replaces this one, and the clock will command to terminate; a participant that refuses this request leaves as well.
    Move {
        /// The new address, in the form of the environment variable, or empty.
        address: String,
    },
    /// Leave.
    Terminate,
}

/// From a participant to the orchestrator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// To [`Request::Hello`].
    Hello {
        /// The participant's [`PROTOCOL`].
        protocol: u32,
        /// Its program and version, for `run.json`.
        program: String,
    },
    /// To [`Request::Configure`].
    Described {
        /// The ports.
        interface: Interface,
    },
    /// To requests that only need to be carried out.
    Done,
    /// To [`Request::Save`]; `None` when the participant cannot be saved.
    State(Option<Vec<u8>>),
    /// The request cannot be fulfilled.
    Refused {
        /// The parameter at fault, dotted, or empty.
        key: String,
        /// Why, with the remedy.
        reason: String,
    },
}

/// How a participant waits: it polls `spins` times, then yields between `yields` polls, then sleeps until it is woken. The result of a
/// run does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct WaitStrategy {
    /// Polls before the first yield.
    pub spins: u32,
    /// Polls with a yield each before sleeping.
    pub yields: u32,
}

impl WaitStrategy {
    /// For a participant with a core of its own.
    pub const SPIN: WaitStrategy = WaitStrategy {
        spins: 20_000,
        yields: 2_000,
    };
    /// For a few participants that share a core: the one waited for needs it, so none of them spins.
    pub const YIELD: WaitStrategy = WaitStrategy {
        spins: 0,
        yields: 2_000,
    };
    /// For many participants that share a core. Every yield passes through all participants that yield, so a hand-off among N of them
    /// costs up to N yields; those with a long wait must sleep for the cost to stay linear. A hand-off to the next participant takes two
    /// yields.
    pub const OVERSUBSCRIBED: WaitStrategy = WaitStrategy { spins: 0, yields: 2 };
    /// For long pauses and machines with other work to do.
    pub const SLEEP: WaitStrategy = WaitStrategy { spins: 0, yields: 0 };
}

/// A participant's message to the recorder between its samples.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum ParticipantEvent {
    /// All activations are complete, and there are no samples after those before this event.
    Finished(WallTimeBreakdown),
    /// The next activation is at or past this horizon, ticks.
    AtHorizon {
        /// The horizon.
        horizon: i64,
        /// The next activation.
        next: u64,
    },
    /// The participant has failed.
    Failed {
        /// The activation.
        activation: u64,
        /// Its instant, as text.
        t: String,
        /// Why.
        reason: String,
    },
    /// Paused at the current activation by a command of the clock; there are no samples after those before this event.
    Paused {
        /// The next activation.
        next: u64,
    },
    /// The spans of wall-clock time, in order; only on request.
    Spans {
        /// The number of spans missing after these, because there was no room for them.
        lost: u64,
        /// The spans.
        spans: Vec<Span>,
    },
}

/// How a participant spent its wall-clock time.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct WallTimeBreakdown {
    /// From the first activation to the last, ns.
    pub total_ns: u64,
    /// Waiting for each link that feeds an input, ns.
    pub inputs_ns: Vec<u64>,
    /// Waiting for room at consumers, ns.
    pub room_ns: u64,
    /// Waiting for the recorder, ns.
    pub recorder_ns: u64,
    /// Waiting for the horizon, ns.
    pub horizon_ns: u64,
    /// The number of sleeps.
    pub sleeps: u64,
}
