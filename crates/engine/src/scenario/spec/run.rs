//! `run = { … }`: which program stands in a participant's place.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::scenario::program::Program;

/// `run = { builtin = "plant" }`, `{ exe = "…", args = […] }`, `{ library = "…", participant = "…" }` or `{ fmu = "…", ports = { … } }`
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RunSpec {
    /// A participant of the program that reads the scenario, by its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub builtin: Option<String>,
    /// A program of its own: a file, or a name in `PATH`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exe: Option<String>,
    /// A shared library with participants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub library: Option<String>,
    /// Which participant of a library; the only one unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub participant: Option<String>,
    /// Arguments of a program of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub args: Vec<String>,
    /// An FMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fmu: Option<String>,
    /// Which variables of an FMU make which ports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ports: Option<Value>,
    /// The messages that ports of an FMU carry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub messages: Option<Value>,
    /// Variables of an FMU that are recorded besides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record: Option<Value>,
    /// Whether outputs of an FMU depend on inputs at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<Value>,
    /// The tolerance that an FMU is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Value>,
}

impl RunSpec {
    /// The participant called `name` of the program itself.
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

    /// What `file` is by its name: a library (`.so`), an FMU (`.fmu`), or else a program.
    pub fn of_file(file: &str) -> RunSpec {
        match Program::key_of(file) {
            "library" => RunSpec::library(file),
            "fmu" => RunSpec::fmu(file),
            _ => RunSpec::exe::<String>(file, []),
        }
    }

    /// The keys that go with `fmu`.
    pub(in crate::scenario) fn beside_fmu(&self) -> Table {
        let given = self.clone().keys_beside_fmu().map(|(key, value)| (key, value.take()));
        given
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?)))
            .collect()
    }

    /// The same, to be changed.
    pub(in crate::scenario) fn keys_beside_fmu(&mut self) -> [(&'static str, &mut Option<Value>); 5] {
        [
            ("ports", &mut self.ports),
            ("messages", &mut self.messages),
            ("record", &mut self.record),
            ("feedthrough", &mut self.feedthrough),
            ("tolerance", &mut self.tolerance),
        ]
    }
}
