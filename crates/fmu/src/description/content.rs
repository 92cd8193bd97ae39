//! The content of a model description.

use std::collections::{BTreeMap, HashMap};

use super::units::Unit;
use super::variable::{Type, Variable};

/// The version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// The FMU's capabilities in co-simulation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Capabilities {
    /// The name of the library; with FMI 2.0 it has no other use.
    pub identifier: String,
    /// It is a wrapper for a tool that must be installed.
    pub needs_execution_tool: bool,
    /// A process may hold one instance only.
    pub once_per_process: bool,
    /// Steps may have different lengths.
    pub variable_step: bool,
    /// The step of its own solver, s, where it is fixed.
    pub fixed_step: Option<f64>,
    /// Its state can be saved and restored.
    pub state: bool,
    /// Its state can be serialised.
    pub serialise: bool,
    /// It has an event mode (FMI 3.0).
    pub event_mode: bool,
}

/// The default experiment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Experiment {
    /// Start, s.
    pub start: Option<f64>,
    /// End, s: after the start.
    pub stop: Option<f64>,
    /// Communication step, s: positive.
    pub step: Option<f64>,
    /// Relative tolerance of its solver.
    pub tolerance: Option<f64>,
}

/// A model description.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// The version of the standard.
    pub version: Version,
    /// The model's name.
    pub model: String,
    /// The exporter's description.
    pub text: String,
    /// The tool that exported it.
    pub tool: String,
    /// The `guid` or `instantiationToken`.
    pub token: String,
    /// Its capabilities in co-simulation.
    pub capabilities: Capabilities,
    /// The default experiment.
    pub experiment: Experiment,
    /// The units by name.
    pub units: BTreeMap<String, Unit>,
    /// The units that have an offset, without it: for relative quantities.
    pub differences: BTreeMap<String, Unit>,
    /// The variables in the order of the file.
    pub variables: Vec<Variable>,
    /// The index of the variable of each name: an FMU may have a hundred thousand.
    pub(super) by_name: HashMap<String, usize>,
    /// The names of the log categories.
    pub log_categories: Vec<String>,
    /// Mistakes in it that can be tolerated.
    pub problems: Vec<String>,
}

/// The index of the variable of each name, among `variables`.
pub(super) fn by_name(variables: &[Variable]) -> HashMap<String, usize> {
    let all = variables.iter().enumerate();
    all.flat_map(|(index, variable)| variable.names().map(move |name| (name.to_owned(), index)))
        .collect()
}

impl Description {
    /// The variable called `name`, by its own name or by an alias.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.by_name.get(name).map(|&index| &self.variables[index])
    }

    /// The identity of the variable's value: variables with equal identities share one value. In FMI 2.0 each type has its
    /// own value references, and enumerations are integers; in FMI 3.0 a reference means one value whatever its type is.
    pub fn value_of(&self, variable: &Variable) -> (Option<Type>, u32) {
        let kind = match (self.version, variable.kind) {
            (Version::Fmi3, _) => None,
            (Version::Fmi2, Type::Enumeration) => Some(Type::Int32),
            (Version::Fmi2, kind) => Some(kind),
        };
        (kind, variable.reference)
    }

    /// The variable's unit, where the description defines it; without an offset for a relative quantity.
    pub fn unit(&self, variable: &Variable) -> Option<&Unit> {
        let name = variable.unit.as_ref()?;
        let difference = self.differences.get(name).filter(|_| variable.relative);
        difference.or_else(|| self.units.get(name))
    }
}
