//! The value of an input before anything is visible.

use lockstep::plan::Initial;
use lockstep::port::{Descriptor, Field};
use toml::Value;

/// Reads `"zero"`, `"first-sample"` or a table of fields, in the units of the descriptor.
pub(super) fn initial(value: &Value, descriptor: &Descriptor) -> Result<Initial, String> {
    match value {
        Value::String(text) if text == "zero" => Ok(Initial::Value(vec![0; descriptor.size as usize])),
        Value::String(text) if text == "first-sample" => Ok(Initial::FirstSample),
        Value::Table(fields) => {
            let mut bytes = vec![0; descriptor.size as usize];
            for (name, value) in fields {
                let field = descriptor.field(name).ok_or_else(|| {
                    let known: Vec<String> = descriptor
                        .fields
                        .iter()
                        .map(|field| format!("`{}`", field.name))
                        .collect();
                    format!(
                        "`{}` has no field `{name}`; it has {}",
                        descriptor.name,
                        known.join(", ")
                    )
                })?;
                write(value, field, &mut bytes[field.range()])?;
            }
            Ok(Initial::Value(bytes))
        }
        other => Err(format!(
            "`{other}` is not an initial value: write \"zero\", \"first-sample\" or {{ field = value, … }}"
        )),
    }
}

fn write(value: &Value, field: &Field, bytes: &mut [u8]) -> Result<(), String> {
    let mut numbers = Vec::new();
    flatten(value, &mut numbers).map_err(|other| format!("`{}`: `{other}` is not a number ({field})", field.name))?;
    if numbers.len() != field.len() {
        return Err(format!(
            "`{}`: {} numbers are given, {} are needed ({field})",
            field.name,
            numbers.len(),
            field.len()
        ));
    }
    for (number, slot) in numbers.iter().zip(bytes.chunks_exact_mut(field.element.size())) {
        field.element.put(*number, slot);
    }
    Ok(())
}

fn flatten(value: &Value, into: &mut Vec<f64>) -> Result<(), String> {
    match value {
        Value::Float(number) => into.push(*number),
        Value::Integer(number) => into.push(*number as f64),
        Value::Array(items) => items.iter().try_for_each(|item| flatten(item, into))?,
        other => return Err(other.to_string()),
    }
    Ok(())
}
