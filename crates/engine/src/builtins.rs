//! Builtins: the participants and assessments of a program that scenarios may name.

use std::collections::BTreeMap;
use std::sync::Arc;

use lockstep::participant::{Factory, ParameterError, Setup};
use toml::Value;

use crate::assessment::{Assessment, AssessmentSetup};
use crate::scenario::Program;

/// Makes an assessment.
pub type AssessmentFactory = Arc<dyn Fn(&AssessmentSetup) -> Result<Box<dyn Assessment>, ParameterError> + Send + Sync>;

/// Makes, in this process, a participant that a scenario names as an external program.
pub(crate) type Within = Arc<dyn Fn(&Program) -> Option<Factory> + Send + Sync>;

/// The participants and the assessments that a program contains, by name.
#[derive(Clone)]
pub struct Builtins {
    version: String,
    participants: BTreeMap<String, Factory>,
    /// Participants that the program itself names in scenarios that it makes; error messages do not list them.
    internal: BTreeMap<String, Factory>,
    assessments: BTreeMap<String, AssessmentFactory>,
    within: Option<Within>,
}

/// A type with builtins: a [`Catalogue`](crate::Catalogue), or the builtins themselves.
pub trait HasBuiltins {
    /// The builtins.
    fn builtins(&self) -> &Arc<Builtins>;
}

impl HasBuiltins for Arc<Builtins> {
    fn builtins(&self) -> &Arc<Builtins> {
        self
    }
}

impl Builtins {
    /// Empty builtins, for a program that calls itself `version`.
    pub(crate) fn new(version: String) -> Builtins {
        Builtins {
            version,
            participants: BTreeMap::new(),
            internal: BTreeMap::new(),
            assessments: BTreeMap::new(),
            within: None,
        }
    }

    pub(crate) fn set_version(&mut self, version: &str) {
        self.version = version.to_owned();
    }

    pub(crate) fn add_participant(&mut self, name: &str, make: Factory) {
        self.participants.insert(name.to_owned(), make);
    }

    pub(crate) fn add_internal(&mut self, name: &str, make: Factory) {
        self.internal.insert(name.to_owned(), make);
    }

    pub(crate) fn add_assessment(&mut self, kind: &str, make: AssessmentFactory) {
        self.assessments.insert(kind.to_owned(), make);
    }

    pub(crate) fn set_within(&mut self, find: Within) {
        self.within = Some(find);
    }

    /// The version as which the program identifies itself.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The participants that a scenario may name, in the order of their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.participants.keys().map(String::as_str)
    }

    /// The factory of the participant called `name`.
    pub fn factory(&self, name: &str) -> Option<&Factory> {
        self.participants.get(name).or_else(|| self.internal.get(name))
    }

    /// The factory of the participant of `program` in this process, if making it loads none of its code; `None` for libraries and
    /// for external programs.
    pub fn factory_of(&self, program: &Program) -> Option<Factory> {
        match program {
            Program::Builtin(name) => self.factory(name).cloned(),
            Program::Fmu { file, options, .. } => {
                let (file, options) = (file.clone(), options.clone());
                Some(Arc::new(move |setup: &Setup| {
                    fmu::participant(&file, &options, setup, false)
                }))
            }
            Program::Library { .. } | Program::External { .. } => None,
        }
    }

    /// The factory of the participant of an external program in this process, if there is one.
    pub fn factory_within(&self, program: &Program) -> Option<Factory> {
        self.within.as_ref().filter(|_| program.is_external())?(program)
    }

    /// Makes the assessment that the table of `setup` describes.
    ///
    /// # Errors
    /// Reports the key that is refused, or the stream that is missing.
    pub fn assess(&self, setup: &AssessmentSetup) -> Result<Box<dyn Assessment>, ParameterError> {
        let known = || {
            let kinds: Vec<String> = self.assessments.keys().map(|kind| format!("`{kind}`")).collect();
            if kinds.is_empty() {
                "this program has no assessments: remove the table".to_owned()
            } else {
                format!("there is {}", kinds.join(", "))
            }
        };
        match setup.table.get("kind") {
            Some(Value::String(kind)) => match self.assessments.get(kind) {
                Some(make) => make(setup),
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
