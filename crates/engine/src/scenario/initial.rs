//! The start value of an input, which it shows before any sample is visible.

use lockstep::plan::Initial;
use lockstep::port::{Descriptor, Element, Field};
use toml::Value;

use super::symbols::symbol;

/// Reads `"zero"`, `"first-sample"` or a table of fields, in the units of the descriptor.
pub(super) fn initial(value: &Value, descriptor: &Descriptor) -> Result<Initial, String> {
    match value {
        Value::String(text) if text == "zero" => Ok(Initial::zero(descriptor.size as usize)),
        Value::String(text) if text == "first-sample" => Ok(Initial::FirstSample),
        Value::Table(_) => payload(value, descriptor).map(Initial::Value),
        other => Err(format!(
            "`{other}` is not an initial value: write \"zero\", \"first-sample\" or {{ field = value, … }}"
        )),
    }
}

/// Reads a table of fields, in the units of the descriptor; fields that are not named are zero.
pub(crate) fn payload(value: &Value, descriptor: &Descriptor) -> Result<Vec<u8>, String> {
    match value {
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
                write_field(value, field, &mut bytes[field.range()])?;
            }
            Ok(bytes)
        }
        other => Err(format!("`{other}` is not a value: write {{ field = value, … }}")),
    }
}

fn write_field(value: &Value, field: &Field, bytes: &mut [u8]) -> Result<(), String> {
    let mut numbers = Vec::new();
    flatten(value, &mut numbers);
    if numbers.len() != field.len() {
        return Err(format!(
            "`{}`: {} numbers are given, {} are needed ({field})",
            field.name,
            numbers.len(),
            field.len()
        ));
    }
    for (number, slot) in numbers.iter().zip(bytes.chunks_exact_mut(field.element.size())) {
        let put = match field.element {
            Element::Bool | Element::Enum => symbol(number, field).map(|byte| slot.fill(byte)),
            Element::Text(_) | Element::Bytes(_) => put_content(number, field.element, slot),
            element => write_number(number, element, slot),
        };
        put.map_err(|reason| format!("`{}`: {reason} ({field})", field.name))?;
    }
    Ok(())
}

fn flatten<'a>(value: &'a Value, into: &mut Vec<&'a Value>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| flatten(item, into)),
        other => into.push(other),
    }
}

/// Writes a text, or bytes from a text in hexadecimal.
pub(super) fn put_content(value: &Value, element: Element, slot: &mut [u8]) -> Result<(), String> {
    let bytes = match (element, value) {
        (Element::Text(_), Value::String(text)) if text.contains('\0') => Err("the text has a zero byte".to_owned()),
        (Element::Text(_), Value::String(text)) => Ok(text.as_bytes().to_owned()),
        (Element::Text(_), other) => Err(format!("`{other}` is not a text: write it in quotes")),
        (_, Value::String(text)) => parse_hexadecimal(text)
            .ok_or_else(|| format!("`{text}` is not bytes: write them in hexadecimal, such as \"0a1b2c\"")),
        (_, other) => Err(format!(
            "`{other}` is not bytes: write them in hexadecimal, such as \"0a1b2c\""
        )),
    };
    element.put_content(&bytes?, slot).map_err(|error| error.to_string())
}

/// Bytes as a scenario writes them.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn parse_hexadecimal(text: &str) -> Option<Vec<u8>> {
    let pairs = text.as_bytes().chunks(2);
    let digit = |letter: u8| char::from(letter).to_digit(16);
    let byte = |pair: &[u8]| match *pair {
        [high, low] => Some((digit(high)? * 16 + digit(low)?) as u8),
        _ => None,
    };
    pairs.map(byte).collect()
}

/// Writes `number` exactly, or returns why an element cannot hold it.
fn write_number(number: &Value, element: Element, slot: &mut [u8]) -> Result<(), String> {
    let Some((least, most)) = element.range() else {
        let value = match number {
            Value::Float(value) => *value,
            Value::Integer(value) => *value as f64,
            other => return Err(format!("`{other}` is not a number")),
        };
        let finite = value.is_finite() && (element == Element::F64 || (value as f32).is_finite());
        if !finite {
            return Err(format!("`{number}` is not a finite number of this type"));
        }
        element.put(value, slot);
        return Ok(());
    };
    let whole = match number {
        Value::Integer(value) => Some(i128::from(*value)),
        Value::Float(value) if value.fract() == 0.0 => Some(*value as i128),
        // TOML's own integers end at 2^63.
        Value::String(text) => text.parse().ok(),
        _ => None,
    };
    let whole = whole
        .filter(|whole| (least..=most).contains(whole))
        .ok_or_else(|| format!("`{number}` is not a whole number from {least} to {most}"))?;
    slot.copy_from_slice(&whole.to_le_bytes()[..slot.len()]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put_into(element: Element, text: &str) -> Result<Vec<u8>, String> {
        let table: toml::Table = format!("x = {text}").parse().unwrap();
        let mut slot = vec![0; element.size()];
        write_number(&table["x"], element, &mut slot).map(|()| slot)
    }

    #[test]
    fn initial_number_is_exact_or_refused() {
        let exact = i64::MAX - 1;
        assert_eq!(
            put_into(Element::I64, &exact.to_string()),
            Ok(exact.to_le_bytes().to_vec())
        );
        assert_eq!(
            put_into(Element::U64, &exact.to_string()),
            Ok((exact as u64).to_le_bytes().to_vec())
        );
        assert_eq!(
            put_into(Element::U64, "\"18446744073709551615\""),
            Ok(u64::MAX.to_le_bytes().to_vec())
        );
        assert_eq!(put_into(Element::I32, "-7"), Ok((-7_i32).to_le_bytes().to_vec()));
        assert_eq!(put_into(Element::U8, "255.0"), Ok(vec![255]));
        assert_eq!(put_into(Element::I8, "-128"), Ok(vec![0x80]));
        assert_eq!(put_into(Element::U16, "65535"), Ok(vec![0xff, 0xff]));
        assert_eq!(put_into(Element::F64, "2"), Ok(2.0_f64.to_le_bytes().to_vec()));
        for (element, text) in [
            (Element::F64, "nan"),
            (Element::F64, "-inf"),
            (Element::F32, "1e300"),
            (Element::F64, "true"),
            (Element::U8, "256"),
            (Element::I8, "128"),
            (Element::I16, "40000"),
            (Element::U16, "-1"),
            (Element::U64, "-1"),
            (Element::I32, "0.5"),
            (Element::I64, "1e19"),
            (Element::U32, "nan"),
        ] {
            assert!(put_into(element, text).is_err(), "{element:?} {text}");
        }
    }
}
