//! `[[faults]]` as a value: a fault, where it acts, when, and how.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::run::RunSpec;
use super::time::Time;

/// The state with which a substitute starts in mid-run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// A cold start, as at the start of a run.
    #[default]
    Cold,
    /// The state that its predecessor has saved.
    Keep,
}

impl State {
    /// The name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            State::Cold => "cold",
            State::Keep => "keep",
        }
    }
}

/// What a fault does to a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// Adds a value.
    Bias,
    /// Multiplies by a factor.
    Scale,
    /// Adds a value that grows with time.
    Ramp,
    /// Adds random values.
    Noise,
    /// Keeps its last value, or takes a given one.
    Stuck,
    /// Samples are lost.
    Dropout,
    /// Bits are flipped.
    BitFlip,
}

impl FaultKind {
    /// Whether it affects some samples and leaves others unchanged.
    pub(in crate::scenario) fn is_intermittent(self) -> bool {
        matches!(self, FaultKind::Dropout | FaultKind::BitFlip)
    }

    /// The name in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            FaultKind::Bias => "bias",
            FaultKind::Scale => "scale",
            FaultKind::Ramp => "ramp",
            FaultKind::Noise => "noise",
            FaultKind::Stuck => "stuck",
            FaultKind::Dropout => "dropout",
            FaultKind::BitFlip => "bit-flip",
        }
    }
}

/// A fault of an input, an output or a connection, or a substitution of a participant: exactly one of `input`, `output`,
/// `connection` and `substitute` is given, with the keys that belong to it.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    rename_all = "kebab-case",
    expecting = "a table with the keys of a fault, such as { at = \"1 s\", output = \"PARTICIPANT.OUTPUT\", kind = \"dropout\" }"
)]
pub struct FaultSpec {
    /// Its name; a name made of its number in the list unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// When it begins.
    pub at: Time,
    /// When it ends; never unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub until: Option<Time>,
    /// `PARTICIPANT.INPUT`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input: Option<String>,
    /// `PARTICIPANT.OUTPUT`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<String>,
    /// The field or element; all of the signal unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// What it does to the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kind: Option<FaultKind>,
    /// The size of the fault, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<Value>,
    /// The bit that is flipped; any bit unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bit: Option<u32>,
    /// The probability for each sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// The name of a connection.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connection: Option<String>,
    /// The probability that the connection loses a sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop: Option<f64>,
    /// The additional delay of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extra_delay: Option<Time>,
    /// The participant that is replaced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substitute: Option<String>,
    /// The program that replaces it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunSpec>,
    /// The parameters of the substitute; those of the participant unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<Table>,
    /// The state with which the substitute starts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<State>,
}

impl FaultSpec {
    /// A fault of the input `port`: one participant reads faulty values from `at` on.
    pub fn input(port: &str, at: impl Into<Time>, kind: FaultKind) -> FaultSpec {
        FaultSpec {
            at: at.into(),
            input: Some(port.to_owned()),
            kind: Some(kind),
            ..FaultSpec::default()
        }
    }

    /// A fault of the output `port`: its readers receive faulty values from `at` on.
    pub fn output(port: &str, at: impl Into<Time>, kind: FaultKind) -> FaultSpec {
        FaultSpec {
            at: at.into(),
            output: Some(port.to_owned()),
            kind: Some(kind),
            ..FaultSpec::default()
        }
    }

    /// A fault of the connection called `name`, which loses or delays samples from `at` on.
    pub fn connection(name: &str, at: impl Into<Time>) -> FaultSpec {
        FaultSpec {
            at: at.into(),
            connection: Some(name.to_owned()),
            ..FaultSpec::default()
        }
    }

    /// Replaces `participant` by `run` from `at` on.
    pub fn substitute(participant: &str, at: impl Into<Time>, run: RunSpec) -> FaultSpec {
        FaultSpec {
            at: at.into(),
            substitute: Some(participant.to_owned()),
            run: Some(run),
            ..FaultSpec::default()
        }
    }

    /// Sets its name.
    #[must_use]
    pub fn named(mut self, name: &str) -> FaultSpec {
        self.name = Some(name.to_owned());
        self
    }

    /// Sets when it ends.
    #[must_use]
    pub fn until(mut self, until: impl Into<Time>) -> FaultSpec {
        self.until = Some(until.into());
        self
    }

    /// Sets the field or element that it affects.
    #[must_use]
    pub fn field(mut self, field: &str) -> FaultSpec {
        self.field = Some(field.to_owned());
        self
    }

    /// Sets its size, with its unit, such as `"0.2 deg"`.
    #[must_use]
    pub fn value(mut self, value: impl Into<Value>) -> FaultSpec {
        self.value = Some(value.into());
        self
    }

    /// Sets the probability for each sample.
    #[must_use]
    pub fn probability(mut self, probability: f64) -> FaultSpec {
        self.probability = Some(probability);
        self
    }

    /// Sets the bit that is flipped.
    #[must_use]
    pub fn bit(mut self, bit: u32) -> FaultSpec {
        self.bit = Some(bit);
        self
    }

    /// Sets the probability that the connection loses a sample.
    #[must_use]
    pub fn dropping(mut self, probability: f64) -> FaultSpec {
        self.drop = Some(probability);
        self
    }

    /// Sets the additional delay of samples.
    #[must_use]
    pub fn extra_delay(mut self, delay: impl Into<Time>) -> FaultSpec {
        self.extra_delay = Some(delay.into());
        self
    }

    /// Sets the parameters of the substitute.
    #[must_use]
    pub fn parameters(mut self, parameters: Table) -> FaultSpec {
        self.parameters = Some(parameters);
        self
    }

    /// Sets the state with which the substitute starts.
    #[must_use]
    pub fn state(mut self, state: State) -> FaultSpec {
        self.state = Some(state);
        self
    }

    /// The keys that are given, in the order of their names.
    pub(in crate::scenario) fn given_keys(&self) -> Vec<&'static str> {
        let keys = [
            ("bit", self.bit.is_some()),
            ("connection", self.connection.is_some()),
            ("drop", self.drop.is_some()),
            ("extra-delay", self.extra_delay.is_some()),
            ("field", self.field.is_some()),
            ("input", self.input.is_some()),
            ("kind", self.kind.is_some()),
            ("output", self.output.is_some()),
            ("parameters", self.parameters.is_some()),
            ("probability", self.probability.is_some()),
            ("run", self.run.is_some()),
            ("state", self.state.is_some()),
            ("substitute", self.substitute.is_some()),
            ("until", self.until.is_some()),
            ("value", self.value.is_some()),
        ];
        keys.into_iter()
            .filter(|(_, given)| *given)
            .map(|(key, _)| key)
            .collect()
    }
}
