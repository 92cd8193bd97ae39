//! `run = { … }`: the program that runs as a participant.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::scenario::program::Program;

/// `run = { builtin = "plant" }`, `{ exe = "…", args = […] }`, `{ library = "…", participant = "…" }` or `{ fmu = "…", ports = { … } }`
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a program: { builtin = \"NAME\" }, { exe = \"FILE\", args = […] }, { library = \"FILE.so\" } or { fmu = \"FILE.fmu\" }"
)]
pub struct RunSpec {
    /// The name of a participant that the program reading the scenario contains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub builtin: Option<String>,
    /// An external program: a file, or a name in `PATH`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exe: Option<String>,
    /// A shared library with participants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub library: Option<String>,
    /// Which participant of a library; its only one unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub participant: Option<String>,
    /// The arguments of an external program.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub args: Vec<String>,
    /// An FMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fmu: Option<String>,
    /// Which variables of an FMU form which ports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ports: Option<Value>,
    /// The messages that ports of an FMU carry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub messages: Option<Value>,
    /// Additional variables of an FMU that are recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<Value>,
    /// Whether outputs of an FMU have direct feedthrough from inputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<Value>,
    /// The tolerance that is passed to an FMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Value>,
}

impl RunSpec {
    /// The builtin participant called `name`.
    pub fn builtin(name: &str) -> RunSpec {
        RunSpec {
            builtin: Some(name.to_owned()),
            ..RunSpec::default()
        }
    }

    /// The program `file` with its arguments.
    pub fn exe<S: Into<String>>(file: &str, args: impl IntoIterator<Item = S>) -> RunSpec {
        RunSpec {
            exe: Some(file.to_owned()),
            args: args.into_iter().map(S::into).collect(),
            ..RunSpec::default()
        }
    }

    /// The only participant of the library `file`.
    pub fn library(file: &str) -> RunSpec {
        RunSpec {
            library: Some(file.to_owned()),
            ..RunSpec::default()
        }
    }

    /// The FMU `file`.
    pub fn fmu(file: &str) -> RunSpec {
        RunSpec {
            fmu: Some(file.to_owned()),
            ..RunSpec::default()
        }
    }

    /// The type of `file` by its name: a library (`.so`), an FMU (`.fmu`), or otherwise a program.
    pub fn of_file(file: &str) -> RunSpec {
        match Program::key_of(file) {
            "library" => RunSpec::library(file),
            "fmu" => RunSpec::fmu(file),
            _ => RunSpec::exe::<String>(file, []),
        }
    }

    /// The keys that go with `fmu`.
    pub(in crate::scenario) fn fmu_options(&self) -> Table {
        let given = self.clone().fmu_options_mut().map(|(key, value)| (key, value.take()));
        given
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?)))
            .collect()
    }

    /// As [`RunSpec::fmu_options`], but mutable.
    pub(in crate::scenario) fn fmu_options_mut(&mut self) -> [(&'static str, &mut Option<Value>); 5] {
        [
            ("ports", &mut self.ports),
            ("messages", &mut self.messages),
            ("record", &mut self.record),
            ("feedthrough", &mut self.feedthrough),
            ("tolerance", &mut self.tolerance),
        ]
    }
}
