//! `[participants.NAME]` as a value: program, sample time, parameters and failure policy.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::run::RunSpec;
use super::time::Time;

/// A participant: its program, its sample time, and its parameters.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table with the keys of a participant, such as { run = { exe = \"FILE\" }, period = \"1 ms\" }"
)]
pub struct ParticipantSpec {
    /// The program. A file may leave it to `--substitute` to name it.
    #[serde(default)]
    pub run: RunSpec,
    /// The time between two activations.
    pub period: Time,
    /// The first activation.
    #[serde(default)]
    pub offset: Time,
    /// Its parameters, in the form that it understands.
    #[serde(default)]
    pub parameters: Table,
    /// What happens when it fails.
    #[serde(default, rename = "on-failure")]
    pub on_failure: OnFailureSpec,
    /// How long its program may take to enter the run and to answer a request.
    #[serde(default, rename = "start-within", skip_serializing_if = "Option::is_none")]
    pub start_within: Option<Time>,
}

/// `on-failure = "stop"`, `"restart-from-checkpoint"`, or `{ substitute = { … } }`
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(from = "OnFailureForm", into = "OnFailureForm")]
pub enum OnFailureSpec {
    /// The run ends.
    #[default]
    Stop,
    /// All participants go back to the last checkpoint, the failed one in a new process.
    RestartFromCheckpoint,
    /// Another program replaces it, with a cold start.
    Substitute(Box<RunSpec>),
}

#[derive(Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "write \"stop\", \"restart-from-checkpoint\" or { substitute = { exe = \"FILE\" } }"
)]
enum OnFailureForm {
    Named(OnFailureName),
    Substitute(Box<Substitute>),
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum OnFailureName {
    Stop,
    RestartFromCheckpoint,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Substitute {
    substitute: RunSpec,
}

impl From<OnFailureForm> for OnFailureSpec {
    fn from(written: OnFailureForm) -> OnFailureSpec {
        match written {
            OnFailureForm::Named(OnFailureName::Stop) => OnFailureSpec::Stop,
            OnFailureForm::Named(OnFailureName::RestartFromCheckpoint) => OnFailureSpec::RestartFromCheckpoint,
            OnFailureForm::Substitute(by) => OnFailureSpec::Substitute(Box::new(by.substitute)),
        }
    }
}

impl From<OnFailureSpec> for OnFailureForm {
    fn from(spec: OnFailureSpec) -> OnFailureForm {
        match spec {
            OnFailureSpec::Stop => OnFailureForm::Named(OnFailureName::Stop),
            OnFailureSpec::RestartFromCheckpoint => OnFailureForm::Named(OnFailureName::RestartFromCheckpoint),
            OnFailureSpec::Substitute(run) => OnFailureForm::Substitute(Box::new(Substitute { substitute: *run })),
        }
    }
}

impl ParticipantSpec {
    /// A participant that runs `run`, without a period yet.
    pub fn new(run: RunSpec) -> ParticipantSpec {
        ParticipantSpec {
            run,
            ..ParticipantSpec::default()
        }
    }

    /// The builtin participant called `name`.
    pub fn builtin(name: &str) -> ParticipantSpec {
        ParticipantSpec::new(RunSpec::builtin(name))
    }

    /// Sets the time between two activations.
    #[must_use]
    pub fn every(mut self, period: impl Into<Time>) -> ParticipantSpec {
        self.period = period.into();
        self
    }

    /// Sets the first activation.
    #[must_use]
    pub fn offset(mut self, offset: impl Into<Time>) -> ParticipantSpec {
        self.offset = offset.into();
        self
    }

    /// Sets all parameters, from any value that serde serialises as a table.
    ///
    /// # Errors
    /// When serde does not serialise it as a table.
    pub fn parameters(mut self, parameters: &impl Serialize) -> Result<ParticipantSpec, toml::ser::Error> {
        self.parameters = Table::try_from(parameters)?;
        Ok(self)
    }

    /// Sets one parameter.
    #[must_use]
    pub fn parameter(mut self, key: &str, value: impl Into<Value>) -> ParticipantSpec {
        self.parameters.insert(key.to_owned(), value.into());
        self
    }

    /// Sets what happens when it fails.
    #[must_use]
    pub fn on_failure(mut self, on_failure: OnFailureSpec) -> ParticipantSpec {
        self.on_failure = on_failure;
        self
    }

    /// Sets how long its program may take to enter the run and to answer a request.
    #[must_use]
    pub fn start_within(mut self, time: impl Into<Time>) -> ParticipantSpec {
        self.start_within = Some(time.into());
        self
    }
}
