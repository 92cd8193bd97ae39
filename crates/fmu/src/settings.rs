//! Start values and parameters of a scenario, checked against the model description.

use std::collections::BTreeMap;
use std::ffi::CString;

use lockstep::participant::ParameterError;
use lockstep::units::{convert, unit_in};
use toml::{Table, Value};

use crate::abi::{Native, Values};
use crate::description::{Causality, Description, Extent, Type, Variable};
use crate::names::{key, unknown};

/// Maximum number of values of an array.
const VALUES_MAX: u64 = 1 << 20;

/// A value for one variable.
#[derive(Debug, Clone)]
pub struct Setting {
    /// The variable.
    pub reference: u32,
    /// Its name.
    pub name: String,
    /// The value.
    pub value: Content,
}

/// The value of a setting.
#[derive(Debug, Clone)]
pub enum Content {
    /// Numbers.
    Numbers(Values),
    /// A string.
    Text(CString),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// All values that are set before the first step, by the mode in which the standard allows it.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// In configuration mode.
    pub structural: Vec<Setting>,
    /// Before the initialization mode.
    pub start: Vec<Setting>,
    /// In initialization mode.
    pub inputs: Vec<Setting>,
    /// The values of structural parameters, set or not, by reference.
    pub extents: BTreeMap<u32, u64>,
}

/// A number in a scenario, before the type of its variable is known.
#[derive(Debug, Clone, Copy)]
enum Number {
    Float(f64),
    Integer(i128),
}

impl Settings {
    /// Reads `participants.NAME.parameters`: variables by name; names with dots may also be nested tables.
    ///
    /// # Errors
    /// Names the key, the value, and the allowed values.
    pub fn read(description: &Description, table: &Table) -> Result<Settings, ParameterError> {
        let mut given = Vec::new();
        flatten(description, ("", ""), table, &mut given);
        reject_duplicates(description, &given)?;
        // The order in which the FMU gets them does not depend on how they are written.
        given.sort_by(|one, other| one.name.cmp(&other.name));
        let mut settings = Settings::default();
        for variable in &description.variables {
            if variable.causality == Causality::StructuralParameter
                && let Some(start) = variable.start.first().and_then(|start| start.parse().ok())
            {
                settings.extents.insert(variable.reference, start);
            }
        }
        // Structural parameters first, because extents of arrays depend on them.
        for structural in [true, false] {
            for GivenValue { name, value, .. } in &given {
                let found = description.variable(name);
                let variable = found.ok_or_else(|| {
                    let known = description.variables.iter().filter(|one| one.settable().is_ok());
                    ParameterError::new(name, unknown(name, known.flat_map(Variable::names)))
                })?;
                if structural == (variable.causality == Causality::StructuralParameter) {
                    settings
                        .put(description, variable, value)
                        .map_err(|reason| ParameterError::new(name, reason))?;
                }
            }
        }
        Ok(settings)
    }

    fn put(&mut self, description: &Description, variable: &Variable, value: &Value) -> Result<(), String> {
        variable
            .settable()
            .map_err(|reason| format!("it cannot be set: {reason}"))?;
        let setting = Setting {
            reference: variable.reference,
            name: variable.name.clone(),
            value: self.content(description, variable, value)?,
        };
        match variable.causality {
            Causality::StructuralParameter => {
                if let Content::Numbers(values) = &setting.value {
                    self.extents
                        .insert(variable.reference, u64::from_ne_bytes(values.bytes(0)));
                }
                self.structural.push(setting);
            }
            Causality::Input => self.inputs.push(setting),
            _ => self.start.push(setting),
        }
        Ok(())
    }

    /// Whether it is an array without elements, which is no signal.
    pub fn is_empty(&self, variable: &Variable) -> bool {
        variable.extents.iter().any(|extent| match extent {
            Extent::Fixed(extent) => *extent == 0,
            Extent::Parameter(reference) => self.extents.get(reference) == Some(&0),
        })
    }

    /// The extents of an array.
    ///
    /// # Errors
    /// When one is unknown or zero, or the array too large.
    pub fn shape(&self, variable: &Variable) -> Result<Vec<u32>, String> {
        if self.is_empty(variable) {
            return Err(
                "it is an array without elements: leave it out, or make the structural parameter that is its size 1 at least".to_owned(),
            );
        }
        let mut count = 1_u64;
        let mut shape = Vec::new();
        for extent in &variable.extents {
            let extent = match extent {
                Extent::Fixed(extent) => *extent,
                Extent::Parameter(reference) => *self.extents.get(reference).ok_or_else(|| {
                    format!("its size is the value of variable {reference}, which is no structural parameter with a start value")
                })?,
            };
            count = count
                .checked_mul(extent)
                .filter(|count| *count <= VALUES_MAX)
                .ok_or_else(|| format!("it has more than {VALUES_MAX} elements"))?;
            shape.push(extent as u32);
        }
        Ok(shape)
    }

    fn content(&self, description: &Description, variable: &Variable, value: &Value) -> Result<Content, String> {
        match variable.kind {
            Type::String | Type::Binary if !variable.extents.is_empty() => {
                return Err("arrays of strings and binaries cannot be set".to_owned());
            }
            Type::Clock => return Err("clocks are not supported".to_owned()),
            Type::String => {
                let Value::String(text) = value else {
                    return Err(format!("{value} is not text; write it in quotes"));
                };
                return CString::new(text.as_str())
                    .map(Content::Text)
                    .map_err(|_| "the text has a zero byte".to_owned());
            }
            Type::Binary => {
                let bytes = value.as_str().and_then(hexadecimal);
                let bytes = bytes
                    .ok_or_else(|| format!("{value} is not bytes; write them in hexadecimal, such as \"666f6f\""))?;
                let most = variable.range.max.as_ref().and_then(|most| most.parse::<usize>().ok());
                if let Some(most) = most.filter(|most| bytes.len() > *most) {
                    return Err(format!(
                        "it has {} bytes; the FMU takes {most} at most (`maxSize`)",
                        bytes.len()
                    ));
                }
                return Ok(Content::Bytes(bytes));
            }
            _ => {}
        }
        let native = Native::of(description.version, variable.kind).ok_or("its type does not exist in FMI 2.0")?;
        let shape = self.shape(variable)?;
        let count: usize = shape.iter().map(|&extent| extent as usize).product();
        let numbers = numbers(description, variable, value)?;
        if numbers.len() != count {
            return Err(format!("{value} has {} values; {count} are needed", numbers.len()));
        }
        let mut values = Values::new(native, vec![variable.reference], count);
        for (index, number) in numbers.into_iter().enumerate() {
            check(variable, number)?;
            values.put(index, &bytes_of(native, number));
        }
        Ok(Content::Numbers(values))
    }
}

/// A value that the scenario gives.
struct GivenValue<'a> {
    /// The full name of the variable, its own or an alias.
    name: String,
    /// The key as written.
    written: String,
    value: &'a Value,
}

/// All values that are given: a table is a group of variables unless a variable has its name.
fn flatten<'a>(description: &Description, above: (&str, &str), table: &'a Table, given: &mut Vec<GivenValue<'a>>) {
    for (name, value) in table {
        let (name, written) = if above.0.is_empty() {
            (name.clone(), key(name))
        } else {
            (format!("{}.{name}", above.0), format!("{}.{}", above.1, key(name)))
        };
        match value {
            Value::Table(inner) if description.variable(&name).is_none() && !inner.is_empty() => {
                flatten(description, (&name, &written), inner, given);
            }
            _ => given.push(GivenValue { name, written, value }),
        }
    }
}

/// Refuses a value that is given twice: under one name, or under two names of one value.
fn reject_duplicates(description: &Description, given: &[GivenValue<'_>]) -> Result<(), ParameterError> {
    let mut named: BTreeMap<&str, &GivenValue<'_>> = BTreeMap::new();
    let mut values: BTreeMap<(Option<Type>, u32), &GivenValue<'_>> = BTreeMap::new();
    for one in given {
        let before = named.insert(&one.name, one);
        let before = before.or_else(|| {
            let variable = description.variable(&one.name)?;
            values.insert(description.value_of(variable), one)
        });
        if let Some(before) = before {
            let names = match before.name == one.name {
                true => String::new(),
                false => format!(", because `{}` and `{}` are one value", before.name, one.name),
            };
            let reason = format!(
                "it is given twice{names}: `{} = {}` and `{} = {}`; remove one of them",
                before.written, before.value, one.written, one.value
            );
            return Err(ParameterError::new(&one.name, reason));
        }
    }
    Ok(())
}

fn hexadecimal(text: &str) -> Option<Vec<u8>> {
    if !text.is_ascii() || !text.len().is_multiple_of(2) {
        return None;
    }
    (0..text.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&text[at..at + 2], 16).ok())
        .collect()
}

/// The numbers that a value represents, in the unit of the FMU.
fn numbers(description: &Description, variable: &Variable, value: &Value) -> Result<Vec<Number>, String> {
    let one = |value: &Value| number(variable, value);
    match (variable.kind.is_float(), value) {
        (true, Value::String(text)) => quantity(description, variable, text),
        (true, _) if let Some(unit) = description.unit(variable).filter(|unit| !unit.is_pure()) => {
            let port = unit.of_port().unit;
            let unit = if port == "1" { unit.name.as_str() } else { &port };
            let example = if variable.extents.is_empty() {
                "0.5"
            } else {
                "[0.5, 1.5]"
            };
            Err(format!("{value} has no unit; write for example \"{example} {unit}\""))
        }
        (_, Value::Array(all)) => all.iter().map(one).collect(),
        (_, value) => Ok(vec![one(value)?]),
    }
}

fn number(variable: &Variable, value: &Value) -> Result<Number, String> {
    match (variable.kind, value) {
        (kind, Value::Float(value)) if kind.is_float() && value.is_finite() => Ok(Number::Float(*value)),
        (kind, Value::Integer(value)) if kind.is_float() => Ok(Number::Float(*value as f64)),
        (kind, _) if kind.is_float() => Err(format!("{value} is not a finite number")),
        (Type::Boolean, Value::Boolean(value)) => Ok(Number::Integer((*value).into())),
        (Type::Boolean, _) => Err(format!("{value} is neither true nor false")),
        (Type::Enumeration, Value::String(name)) => {
            let found = variable.items.iter().find(|item| item.name == *name);
            found
                .map(|item| Number::Integer(item.value.into()))
                .ok_or_else(|| items(variable, &format!("\"{name}\"")))
        }
        (Type::Enumeration, Value::Integer(value)) => {
            let known = variable.items.is_empty() || variable.items.iter().any(|item| item.value == *value);
            if known {
                Ok(Number::Integer((*value).into()))
            } else {
                Err(items(variable, &value.to_string()))
            }
        }
        (_, Value::Integer(value)) => Ok(Number::Integer((*value).into())),
        // TOML's integers are limited to below 2^63.
        (Type::UInt64, Value::String(text)) => {
            let value = text.trim().parse::<u64>();
            value
                .map(|value| Number::Integer(value.into()))
                .map_err(|_| format!("\"{text}\" is not a whole number"))
        }
        (_, value) => Err(format!("{value} is not a whole number")),
    }
}

fn items(variable: &Variable, value: &str) -> String {
    let known: Vec<String> = variable
        .items
        .iter()
        .map(|item| format!("\"{}\" ({})", item.name, item.value))
        .collect();
    format!("{value} is no item of the enumeration; there is {}", known.join(", "))
}

/// `"0.5 mm"` or `"[1, 2] mm"` in the unit of the FMU.
fn quantity(description: &Description, variable: &Variable, text: &str) -> Result<Vec<Number>, String> {
    let Some(unit) = description.unit(variable) else {
        let read = convert(text, "1")
            .map_err(|_| format!("\"{text}\": the variable has no unit; write a number without quotes"))?;
        return Ok(read.0.into_iter().map(Number::Float).collect());
    };
    // The FMU's own unit: no conversion.
    let name = unit.name.trim();
    let own = text.trim().strip_suffix(name).filter(|_| unit_in(text) == Some(name));
    if let Some((values, _)) = own.and_then(|numbers| convert(&format!("{numbers} 1"), "1").ok()) {
        return Ok(values.into_iter().map(Number::Float).collect());
    }
    let port = unit.of_port();
    let (values, _) = convert(text, &port.unit).map_err(|error| error.to_string())?;
    Ok(values
        .into_iter()
        .map(|value| Number::Float((value - port.offset) / port.factor))
        .collect())
}

/// Whether a value is within the limits of the variable and of its type.
fn check(variable: &Variable, number: Number) -> Result<(), String> {
    let unit = variable.unit.as_deref().unwrap_or_default();
    let (min, max) = (variable.range.min.as_deref(), variable.range.max.as_deref());
    let within = |low: Option<bool>, high: Option<bool>, value: String| {
        if low == Some(false) {
            return Err(format!(
                "{value} {unit} is below the minimum {} {unit}",
                min.unwrap_or_default()
            ));
        }
        if high == Some(false) {
            return Err(format!(
                "{value} {unit} is above the maximum {} {unit}",
                max.unwrap_or_default()
            ));
        }
        Ok(())
    };
    match number {
        Number::Float(value) => {
            let (fits, largest) = match variable.kind {
                Type::Float32 => ((value as f32).is_finite(), f64::from(f32::MAX)),
                _ => (value.is_finite(), f64::MAX),
            };
            if !fits {
                let kind = variable.kind.name();
                return Err(
                    format!("{value:?} {unit} is no {kind}: from {:?} to {largest:?}", -largest).replace("  ", " "),
                );
            }
            let limit = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok());
            within(
                limit(min).map(|min| value >= min),
                limit(max).map(|max| value <= max),
                value.to_string(),
            )
        }
        Number::Integer(value) => {
            let limit = |text: Option<&str>| text.and_then(|text| text.parse::<i128>().ok());
            if let Some((least, largest)) = variable.kind.integers()
                && !(least..=largest).contains(&value)
            {
                return Err(format!(
                    "{value} is no {}: from {least} to {largest}",
                    variable.kind.name()
                ));
            }
            within(
                limit(min).map(|min| value >= min),
                limit(max).map(|max| value <= max),
                value.to_string(),
            )
        }
    }
    .map_err(|reason| reason.replace("  ", " ").trim().to_owned())
}

fn bytes_of(native: Native, number: Number) -> [u8; 8] {
    let mut bytes = [0; 8];
    let size = native.size();
    match (native, number) {
        (Native::F64, Number::Float(value)) => bytes.copy_from_slice(&value.to_ne_bytes()),
        (Native::F32, Number::Float(value)) => bytes[..4].copy_from_slice(&(value as f32).to_ne_bytes()),
        (_, Number::Integer(value)) => bytes[..size].copy_from_slice(&value.to_le_bytes()[..size]),
        (_, Number::Float(value)) => bytes[..size].copy_from_slice(&(value as i128).to_le_bytes()[..size]),
    }
    bytes
}

#[cfg(test)]
mod tests;
