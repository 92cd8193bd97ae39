//! What the orchestrator and a participant say to each other outside the data path.

use serde::{Deserialize, Serialize};

use crate::participant::Interface;
use crate::plan::{Assignment, Position};
use crate::span::Span;

/// The version of the protocol. Both sides must have the same.
pub const PROTOCOL: u32 = 7;

/// From the orchestrator to a participant; each is answered by one [`Reply`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Who are you?
    Hello {
        /// The orchestrator's [`PROTOCOL`].
        protocol: u32,
    },
    /// These are your parameters; tell your ports.
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
    /// This is your part of the plan; open your links and get ready. Nothing is published before the horizon moves.
    Connect {
        /// The part of the plan.
        assignment: Assignment,
        /// The cores to run on; empty to leave it to the operating system.
        cores: Vec<u32>,
        /// How to wait.
        waiting: Waiting,
        /// The size of the record's ring, bytes: a multiple of 64.
        record: u32,
        /// Where to take up the work; nothing at the start of a run.
        position: Option<Box<Position>>,
    },
    /// Give your state. Only at rest.
    Save,
    /// Leave all links and enter the run again at this address, with the model as it is. Only at rest. Without an address: another
    /// one takes this place, and the clock will say leave; a participant that refuses this leaves as well.
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
        /// Its program and version, for the run's record.
        program: String,
    },
    /// To [`Request::Configure`].
    Described {
        /// The ports.
        interface: Interface,
    },
    /// To requests that only need to be done.
    Done,
    /// To [`Request::Save`]; `None` when the participant cannot be saved.
    State(Option<Vec<u8>>),
    /// The request cannot be fulfilled.
    Refused {
        /// The parameter that is to blame, dotted, or empty.
        key: String,
        /// Why, with the remedy.
        reason: String,
    },
}

/// How a participant waits: it looks again at once `spins` times, then lets others run `yields` times, then sleeps until it
/// is woken. The result of a run does not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Waiting {
    /// Looks before the first yield.
    pub spins: u32,
    /// Looks with a yield each before sleeping.
    pub yields: u32,
}

impl Waiting {
    /// For a participant with a core of its own.
    pub const SPIN: Waiting = Waiting {
        spins: 20_000,
        yields: 2_000,
    };
    /// For a few participants that share a core: the one waited for needs it, so nobody spins.
    pub const YIELD: Waiting = Waiting {
        spins: 0,
        yields: 2_000,
    };
    /// For many participants that share a core. Every yield passes through all who yield, so a hand-off among N of them
    /// costs up to N yields; those who wait for long must sleep for the cost to stay linear. Two yields are what a hand-off
    /// to the next one takes.
    pub const CROWD: Waiting = Waiting { spins: 0, yields: 2 };
    /// For long pauses and machines that have better things to do.
    pub const SLEEP: Waiting = Waiting { spins: 0, yields: 0 };
}

/// What a participant tells the recorder between its samples.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Note {
    /// All activations are complete, and every sample before this note is all there is.
    Finished(Timing),
    /// At rest: the next activation lies at or past this horizon, ticks.
    AtRest {
        /// The horizon.
        horizon: i64,
        /// The next activation.
        next: u64,
    },
    /// The participant cannot go on.
    Failed {
        /// The activation.
        activation: u64,
        /// Its instant, as text.
        t: String,
        /// Why.
        reason: String,
    },
    /// At rest because the clock said so, wherever that was; every sample before this note is all there is.
    Recalled {
        /// The next activation.
        next: u64,
    },
    /// What was done when, in order; only where it was asked for.
    Spans {
        /// How many spans are missing behind these, because there was no room for them.
        lost: u64,
        /// What was done.
        spans: Vec<Span>,
    },
}

/// Where the wall time of a participant went.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timing {
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
    /// Times it had to sleep.
    pub sleeps: u64,
}
