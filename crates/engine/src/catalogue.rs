//! The catalogue: the participants and the assessments that a program contains.

use std::collections::BTreeMap;
use std::sync::Arc;

use lockstep::participant::{Factory, ParameterError, Participant, Setup};
use tape::StreamSpec;
use toml::{Table, Value};

use crate::assessment::Assessment;
use crate::replay::player;

/// Makes an assessment from the table `assessment` of a scenario and the streams of the run.
pub type AssessmentFactory =
    Arc<dyn Fn(&Table, &[StreamSpec]) -> Result<Box<dyn Assessment>, ParameterError> + Send + Sync>;

/// What a scenario can name without a program of its own.
///
/// ```
/// use engine::Catalogue;
/// # use lockstep::participant::{ParameterError, Participant, Setup};
/// # fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> { Err(ParameterError::new("", "an example")) }
///
/// let catalogue = Catalogue::new("lander 1.0").participant("lander", make);
/// assert!(catalogue.names().eq(["lander"]));
/// ```
#[derive(Clone)]
pub struct Catalogue {
    version: String,
    participants: BTreeMap<String, Factory>,
    /// Participants that the program itself names in scenarios that it makes; an error message does not offer them.
    internal: BTreeMap<String, Factory>,
    assessments: BTreeMap<String, AssessmentFactory>,
}

impl Catalogue {
    /// A catalogue without entries of a program that calls itself `version`, such as `lander 1.0`.
    pub fn new(version: impl Into<String>) -> Catalogue {
        let catalogue = Catalogue {
            version: version.into(),
            participants: BTreeMap::new(),
            internal: BTreeMap::new(),
            assessments: BTreeMap::new(),
        };
        catalogue.internal(player::NAME, player::factory)
    }

    /// With a participant that scenarios name as `run = { builtin = "NAME" }`.
    #[must_use]
    pub fn participant(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.participants.insert(name.to_owned(), Arc::new(make));
        self
    }

    /// With a participant that only scenarios made by the program itself name.
    #[must_use]
    pub fn internal(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.internal.insert(name.to_owned(), Arc::new(make));
        self
    }

    /// With an assessment that scenarios name as `kind = "KIND"` in the table `assessment`.
    #[must_use]
    pub fn assessment(
        mut self,
        kind: &str,
        make: impl Fn(&Table, &[StreamSpec]) -> Result<Box<dyn Assessment>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.assessments.insert(kind.to_owned(), Arc::new(make));
        self
    }

    /// What the program calls itself.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The participants that a scenario may name, in the order of their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.participants.keys().map(String::as_str)
    }

    /// How the participant called `name` is made.
    pub fn factory(&self, name: &str) -> Option<&Factory> {
        self.participants.get(name).or_else(|| self.internal.get(name))
    }

    /// The assessment that the table `assessment` of a scenario describes.
    ///
    /// # Errors
    /// Names the key that is refused, or the stream that is missing.
    pub fn assess(&self, table: &Table, streams: &[StreamSpec]) -> Result<Box<dyn Assessment>, ParameterError> {
        let known = || {
            let kinds: Vec<String> = self.assessments.keys().map(|kind| format!("`{kind}`")).collect();
            if kinds.is_empty() {
                "this program has no assessments: remove the table".to_owned()
            } else {
                format!("there is {}", kinds.join(", "))
            }
        };
        match table.get("kind") {
            Some(Value::String(kind)) => match self.assessments.get(kind) {
                Some(make) => make(table, streams),
                None => Err(ParameterError::new(
                    "kind",
                    format!("there is no assessment `{kind}`; {}", known()),
                )),
            },
            Some(other) => Err(ParameterError::new(
                "kind",
                format!("{other} is not a name; {}", known()),
            )),
            None => Err(ParameterError::new("kind", format!("missing; {}", known()))),
        }
    }
}
