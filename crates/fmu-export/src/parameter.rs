//! The parameters of a participant that an importer may set: truth values, numbers, quantities, lists of them, and short texts.

use lockstep::port::Element;
use lockstep::units;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::kind::VariableKind;
use crate::unit;

/// The longest text that is exported as a parameter, bytes: the contents of files are not.
const TEXT_MAX: usize = 200;
/// The longest list that is exported as a parameter, elements.
const LIST_MAX: usize = 256;

/// A parameter and its present value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `parameters.gains.kp`, or `seed`.
    pub name: String,
    /// Its type.
    pub kind: VariableKind,
    /// Its extents; empty for a number.
    pub extents: Vec<u32>,
    /// Its unit; `1` without one.
    pub unit: String,
    /// The present value.
    pub value: ParameterValue,
    /// Whether the value differs from that of the scenario.
    pub changed: bool,
}

fn number() -> VariableKind {
    VariableKind::Number(Element::F64)
}

/// A value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ParameterValue {
    /// As the elements of a payload.
    Bytes(Vec<u8>),
    /// A text.
    Text(String),
}

impl Parameter {
    fn new(name: String, kind: VariableKind, extents: Vec<u32>, unit: &str, value: ParameterValue) -> Parameter {
        Parameter {
            name,
            kind,
            extents,
            unit: unit.to_owned(),
            value,
            changed: false,
        }
    }

    /// The number of elements.
    pub fn len(&self) -> usize {
        self.extents.iter().map(|&extent| extent as usize).product()
    }

    /// The value as a scenario states it.
    fn to_toml(&self) -> Value {
        let bytes = match &self.value {
            ParameterValue::Text(text) => return Value::String(text.clone()),
            ParameterValue::Bytes(bytes) => bytes,
        };
        let size = self.kind.size();
        let one = |bytes: &[u8]| match self.kind {
            VariableKind::Boolean => Value::Boolean(bytes[0] != 0),
            VariableKind::Number(Element::F64) => Value::Float(Element::F64.to_f64(bytes)),
            VariableKind::Number(element) => Value::Integer(element.to_integer(bytes) as i64),
            // Not exported as a parameter.
            VariableKind::Enumeration | VariableKind::Text | VariableKind::Content(_) => Value::String(String::new()),
        };
        let all: Vec<Value> = bytes.chunks_exact(size).map(one).collect();
        if unit::is_unit(&self.unit) {
            let numbers: Vec<String> = all.iter().map(Value::to_string).collect();
            let (before, after) = if self.extents.is_empty() { ("", "") } else { ("[", "]") };
            return Value::String(format!("{before}{}{after} {}", numbers.join(", "), self.unit));
        }
        match self.extents.as_slice() {
            [] => all.into_iter().next().unwrap_or(Value::Boolean(false)),
            [_, columns] => {
                let rows = all.chunks(*columns as usize).map(|row| Value::Array(row.to_vec()));
                Value::Array(rows.collect())
            }
            _ => Value::Array(all),
        }
    }

    /// Inserts the value into a participant's parameters.
    pub fn put(&self, parameters: &mut Table) {
        let Some(path) = self.name.strip_prefix(PREFIX) else {
            return;
        };
        let (mut table, mut rest) = (parameters, path);
        while let Some((head, tail)) = rest.split_once('.') {
            let Some(Value::Table(inner)) = table.get_mut(head) else {
                return;
            };
            (table, rest) = (inner, tail);
        }
        table.insert(rest.to_owned(), self.to_toml());
    }
}

/// The prefix of the names of a participant's parameters.
const PREFIX: &str = "parameters.";
/// The seed of the run, which is also exported as a parameter.
pub const SEED: &str = "seed";

/// Everything in `parameters` that can be set, and the seed.
pub fn parameters(parameters: &Table, seed: u64) -> Vec<Parameter> {
    let mut all = Vec::new();
    // FMI 2.0 has no larger numbers; export another seed with --set.
    if let Ok(seed) = i32::try_from(seed) {
        let value = ParameterValue::Bytes(seed.to_le_bytes().to_vec());
        all.push(Parameter::new(
            SEED.into(),
            VariableKind::Number(Element::I32),
            Vec::new(),
            "1",
            value,
        ));
    }
    collect_parameters(PREFIX.trim_end_matches('.'), parameters, &mut all);
    all
}

/// The seed in `all`.
pub fn seed_of(all: &[Parameter], seed: u64) -> Result<u64, String> {
    let Some(ParameterValue::Bytes(bytes)) = all.iter().find(|one| one.name == SEED).map(|one| &one.value) else {
        return Ok(seed);
    };
    let value = Element::I32.to_integer(bytes);
    u64::try_from(value).map_err(|_| format!("the seed is {value}; it must not be negative"))
}

fn collect_parameters(path: &str, table: &Table, all: &mut Vec<Parameter>) {
    for (key, value) in table {
        // A dot in a key would be read as that of a table.
        if key.contains('.') {
            continue;
        }
        let name = format!("{path}.{key}");
        match value {
            Value::Table(inner) => collect_parameters(&name, inner, all),
            value => all.extend(parameter(name, value)),
        }
    }
}

fn parameter(name: String, value: &Value) -> Option<Parameter> {
    Some(match value {
        Value::Boolean(flag) => Parameter::new(
            name,
            VariableKind::Boolean,
            Vec::new(),
            "1",
            ParameterValue::Bytes(vec![u8::from(*flag)]),
        ),
        Value::Integer(whole) => {
            let short = i32::try_from(*whole).ok()?;
            let value = ParameterValue::Bytes(short.to_le_bytes().to_vec());
            Parameter::new(name, VariableKind::Number(Element::I32), Vec::new(), "1", value)
        }
        Value::Float(number) => doubles(name, &[*number], Vec::new(), "1")?,
        Value::String(text) => match quantity(text) {
            Some((unit, (values, listed))) => {
                let extents = if listed {
                    vec![u32::try_from(values.len()).ok()?]
                } else {
                    Vec::new()
                };
                doubles(name, &values, extents, unit)?
            }
            None if text.len() <= TEXT_MAX && !text.contains(['\n', '\r', '\0']) => Parameter::new(
                name,
                VariableKind::Text,
                Vec::new(),
                "1",
                ParameterValue::Text(text.clone()),
            ),
            None => return None,
        },
        Value::Array(values) => {
            let (numbers, extents) = array(values)?;
            doubles(name, &numbers, extents, "1")?
        }
        Value::Datetime(_) | Value::Table(_) => return None,
    })
}

/// The unit and the numbers of a text that is a quantity, and whether they are in brackets.
fn quantity(text: &str) -> Option<(&str, (Vec<f64>, bool))> {
    let unit = units::unit_in(text)?;
    units::unit_factor(unit).ok()?;
    Some((unit, units::convert(text, unit).ok()?))
}

fn doubles(name: String, values: &[f64], extents: Vec<u32>, unit: &str) -> Option<Parameter> {
    let good = !values.is_empty() && values.len() <= LIST_MAX && values.iter().all(|value| value.is_finite());
    let value = ParameterValue::Bytes(values.iter().flat_map(|value| value.to_le_bytes()).collect());
    good.then(|| Parameter::new(name, number(), extents, unit, value))
}

/// A list of numbers, or of lists with equal numbers of elements.
fn array(values: &[Value]) -> Option<(Vec<f64>, Vec<u32>)> {
    let count = u32::try_from(values.len()).ok()?;
    if let Some(numbers) = values.iter().map(Value::as_float).collect::<Option<Vec<f64>>>() {
        return Some((numbers, vec![count]));
    }
    let rows: Vec<(Vec<f64>, Vec<u32>)> = values.iter().map(|row| array(row.as_array()?)).collect::<Option<_>>()?;
    let columns = rows.first().and_then(|(_, extents)| match extents.as_slice() {
        [columns] => Some(*columns),
        _ => None,
    })?;
    let even = rows.iter().all(|(_, extents)| *extents == [columns]);
    even.then(|| {
        (
            rows.into_iter().flat_map(|(numbers, _)| numbers).collect(),
            vec![count, columns],
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameter_values_match_scenario_text() {
        let text = "a = 0.1\nb = 7\nc = true\nd = \"2.5 mm\"\ne = \"[1, 2.5] rad/s\"\nf = \"spherical\"\ng = [[1.0, 2.0], [3.0, 4.0]]\n\
                    h = { i = \"30 Hz\" }\nj = \"\"\"\nlong\n\"\"\"";
        let table: Table = text.parse().unwrap();
        let mut all = parameters(&table, 5);
        let names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
        let expected = ["seed", "a", "b", "c", "d", "e", "f", "g", "h.i"];
        let expected: Vec<String> = expected
            .iter()
            .map(|name| match *name {
                "seed" => "seed".to_owned(),
                name => format!("parameters.{name}"),
            })
            .collect();
        assert_eq!(names, expected);
        let mut back = table.clone();
        all.iter().for_each(|one| one.put(&mut back));
        assert_eq!(back["a"], table["a"]);
        assert_eq!(back["g"], table["g"]);
        assert_eq!(back["d"].as_str(), Some("2.5 mm"));
        assert_eq!(back["e"].as_str(), Some("[1.0, 2.5] rad/s"));
        assert_eq!(back["h"]["i"].as_str(), Some("30.0 Hz"));
        all[4].value = ParameterValue::Bytes(3.0_f64.to_le_bytes().to_vec());
        all[4].put(&mut back);
        assert_eq!(back["d"].as_str(), Some("3.0 mm"));
        assert_eq!(seed_of(&all, 9), Ok(5));
    }
}
