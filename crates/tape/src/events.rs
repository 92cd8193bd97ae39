//! Events on a tape, besides the samples: faults, substitutions, failures.

use lockstep::time::Rational;
use serde::{Deserialize, Serialize};

/// The kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// A declared fault began or ended.
    Fault,
    /// Another program replaced a participant.
    Substitution,
    /// A participant died, hung, or broke the protocol.
    Failure,
    /// A participant was started again from a checkpoint.
    Restart,
    /// The state of the run was saved.
    Checkpoint,
    /// The run was resumed from a saved state.
    Resume,
    /// An input without a link was given a value from outside: `text` is `INPUT = { field = value, … }`, as TOML.
    Input,
    /// Any other event worth reporting.
    Note,
}

/// One line of `events.jsonl`. Nothing in it depends on wall-clock time, so two equal runs have equal events.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// The exact simulated time of the event.
    pub time: Rational,
    /// The kind of the event.
    pub kind: EventKind,
    /// The participant concerned; absent for the run as a whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub participant: Option<String>,
    /// A description, one line.
    pub text: String,
}

impl Event {
    /// The line of the event with its line feed.
    pub(crate) fn to_json_line(&self) -> Vec<u8> {
        let mut line = serde_json::to_vec(self).expect("text, a name and a number always serialise");
        line.push(b'\n');
        line
    }

    /// All complete lines of `text`; an incomplete last line is left out. The error names the line, counted from 1.
    pub(crate) fn parse_lines(text: &[u8]) -> Result<Vec<Event>, (usize, serde_json::Error)> {
        let complete = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        text[..complete]
            .split_inclusive(|byte| *byte == b'\n')
            .enumerate()
            .map(|(at, line)| serde_json::from_slice(line).map_err(|error| (at + 1, error)))
            .collect()
    }
}
