//! Options of an FMU in a scenario: the keys of `run` besides its file.

use std::collections::BTreeMap;

use lockstep::participant::ParameterError;
use lockstep::port::Element;
use serde::Deserialize;

/// The keys besides `fmu`.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// The ports by name; inputs or outputs without a named port have one port each, `inputs` and `outputs`.
    pub ports: BTreeMap<String, Vec<FieldEntry>>,
    /// The message types of ports, where the connected participants require other names.
    pub messages: BTreeMap<String, String>,
    /// Variables of any causality that are recorded in an output port `recorded`.
    pub record: Vec<FieldEntry>,
    /// Whether the outputs have direct feedthrough from the inputs.
    pub feedthrough: bool,
    /// The relative tolerance of the FMU's solver; it replaces that of the default experiment.
    pub tolerance: Option<f64>,
}

/// A field of a port.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum FieldEntry {
    /// The variable of this name.
    Plain(String),
    /// A field with its own name.
    Full(FullEntry),
}

/// A field with its own name: of one variable, or of several scalars as one array.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FullEntry {
    /// The field's name; the variable's where it is missing.
    pub name: Option<String>,
    /// The variable, or the scalars that become an array in this order.
    pub variable: Variables,
    /// The unit of the field, where it differs from the variable's.
    pub unit: Option<String>,
    /// The frame of its components.
    #[serde(default)]
    pub frame: String,
    /// The maximum size of a text or of bytes.
    pub size: Option<u32>,
    /// Another integer type than the variable's.
    pub element: Option<Element>,
}

/// The maximum size, and the type of the field.
pub(crate) type Form = (Option<u32>, Option<Element>);

/// One variable or several.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Variables {
    /// One.
    One(String),
    /// Several scalars.
    Many(Vec<String>),
}

impl Options {
    /// Reads the table.
    ///
    /// # Errors
    /// Names the key.
    pub fn read(table: &toml::Table) -> Result<Options, ParameterError> {
        let options: Options = lockstep::units::read(table).map_err(|error| {
            let reason = match error.reason.contains("untagged") {
                true => "a field is the name of a variable, or { name = \"FIELD\", variable = \"NAME\" or [\"NAME\", …], unit = \
                         \"UNIT\", frame = \"FRAME\", size = BYTES, element = \"TYPE\" }"
                    .to_owned(),
                false => error.reason,
            };
            ParameterError::new(error.key, reason)
        })?;
        if let Some(tolerance) = options.tolerance.filter(|one| !(one.is_finite() && *one > 0.0)) {
            let reason = format!("the tolerance is {tolerance}; it must be positive, such as 1e-6");
            return Err(ParameterError::new("tolerance", reason));
        }
        Ok(options)
    }
}

impl FieldEntry {
    /// The maximum size of a text or bytes, and the integer type, where they are given.
    pub(crate) fn form(&self) -> Form {
        match self {
            FieldEntry::Plain(_) => (None, None),
            FieldEntry::Full(full) => (full.size, full.element),
        }
    }

    /// Name, variables, unit and frame.
    pub(crate) fn parts(&self) -> (String, Vec<&str>, bool, Option<&str>, &str) {
        match self {
            FieldEntry::Plain(name) => (name.clone(), vec![name], false, None, ""),
            FieldEntry::Full(full) => {
                let (variables, listed): (Vec<&str>, bool) = match &full.variable {
                    Variables::One(one) => (vec![one], false),
                    Variables::Many(many) => (many.iter().map(String::as_str).collect(), true),
                };
                let name = full.name.as_deref().or(variables.first().copied()).unwrap_or_default();
                (name.to_owned(), variables, listed, full.unit.as_deref(), &full.frame)
            }
        }
    }
}
