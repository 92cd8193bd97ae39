//! Values as given on a command line.

use toml::{Table, Value};

/// Text that is valid TOML is read as TOML; anything else is a string, so that quotes need not survive the shell.
pub fn value(text: &str) -> Value {
    let read = format!("x = {text}").parse::<Table>().ok();
    // More than one key: the text contained another line of TOML.
    let one = read
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("x"));
    one.unwrap_or_else(|| Value::String(text.to_owned()))
}

/// On a command line 0.0 is written as 0: a value that was a decimal number, or a list of them, `before` stays one.
pub(super) fn keep_decimal(value: &mut Value, before: &Value) {
    match (value, before) {
        (value @ Value::Integer(_), Value::Float(_)) => {
            if let Some(whole) = value
                .as_integer()
                .filter(|whole| (*whole as f64) as i128 == i128::from(*whole))
            {
                *value = Value::Float(whole as f64);
            }
        }
        (Value::Array(values), Value::Array(before)) => {
            if let Some(before) = before.first() {
                values.iter_mut().for_each(|value| keep_decimal(value, before));
            }
        }
        _ => {}
    }
}
