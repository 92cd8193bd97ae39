//! Booleans and enumeration values as scenarios write them: `true`, `"open"`, or the number.

use lockstep::port::{Element, Field};
use toml::Value;

/// One value of `field`, which is a boolean or an enumeration.
///
/// # Errors
/// The value that the field does not have, and the values that it has.
pub(super) fn symbol(value: &Value, field: &Field) -> Result<u8, String> {
    let named = match value {
        Value::Boolean(truth) if field.element == Element::Bool => Some(u8::from(*truth)),
        Value::String(text) => {
            let mut values = field.values.iter();
            values.find(|named| named.name == *text).map(|named| named.value)
        }
        Value::Integer(number) => u8::try_from(*number).ok(),
        Value::Float(number) if number.fract() == 0.0 && (0.0..256.0).contains(number) => Some(*number as u8),
        _ => None,
    };
    let named = named.filter(|byte| field.element.room().is_none() && field.allows(f64::from(*byte)));
    named.ok_or_else(|| match field.element {
        Element::Bool => format!("`{value}` is not a truth value: write true or false"),
        Element::Text(_) | Element::Bytes(_) => "texts and bytes cannot be given here".to_owned(),
        _ => {
            let known: Vec<String> = field.values.iter().map(|named| format!("\"{}\"", named.name)).collect();
            format!("`{value}` is none of its values: write {}", known.join(", "))
        }
    })
}

/// One value for each of `count` elements of `field`: one for all, or a list.
pub(super) fn symbols(value: &Value, field: &Field, count: usize) -> Result<Vec<f64>, String> {
    let one = |value: &Value| symbol(value, field).map(f64::from);
    match value {
        Value::Array(items) if items.len() == count => items.iter().map(one).collect(),
        Value::Array(items) => Err(format!(
            "{} values are given for {count} elements: give one for all, or a list of {count}",
            items.len()
        )),
        single => Ok(vec![one(single)?; count]),
    }
}
