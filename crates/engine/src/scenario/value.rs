//! Values as given on a command line.

use toml::{Table, Value};

/// Text that is valid TOML is read as TOML; anything else is a string, so that a command line needs no quotes inside quotes.
pub fn value(text: &str) -> Value {
    let read = format!("x = {text}").parse::<Table>().ok();
    // More than one key: the text contained another line of TOML.
    let one = read
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("x"));
    one.unwrap_or_else(|| Value::String(text.to_owned()))
}

/// As [`value`]. A number that does not fit, and a list or a table in brackets that is not TOML, are refused: as a text they would be
/// refused later for another reason, or accepted as what was not meant. Brackets with a unit behind them are a text.
pub(super) fn checked_value(text: &str) -> Result<Value, String> {
    if is_beyond_doubles(text) {
        return Err(format!(
            "`{text}` is beyond the range of a double, ±1.8e308; a text of digits is written in quotes"
        ));
    }
    let bracketed = [('{', '}'), ('[', ']')];
    let is_structure = bracketed
        .iter()
        .any(|&(open, close)| text.starts_with(open) && text.ends_with(close));
    match format!("x = {text}").parse::<Table>() {
        Err(error) if is_structure => Err(format!(
            "`{text}` is not TOML: {}; a text with brackets around it is written in quotes",
            error.message().trim_end()
        )),
        _ => Ok(value(text)),
    }
}

/// Whether `text` is a number in digits that no finite double represents; `inf` and `nan` are words of TOML.
fn is_beyond_doubles(text: &str) -> bool {
    let begins_as_number = text
        .trim_start_matches(['+', '-'])
        .starts_with(|c: char| c.is_ascii_digit());
    begins_as_number && text.parse::<f64>().is_ok_and(f64::is_infinite)
}

/// Why a value in TOML cannot be read, without its position, and with the words of TOML for its types.
pub(super) fn toml_reason(error: &toml::de::Error) -> String {
    in_words_of_toml(error.message().trim())
}

fn in_words_of_toml(reason: &str) -> String {
    let words = [
        ("invalid type: map", "invalid type: table"),
        ("invalid type: sequence", "invalid type: list"),
        ("expected a map", "expected a table"),
        ("expected a sequence", "expected a list"),
    ];
    let replaced = |text: String, (word, by): (&str, &str)| text.replace(word, by);
    words.into_iter().fold(reason.to_owned(), replaced)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_beyond_a_double_is_refused_and_a_text_is_not() {
        for text in ["1e400", "-1e309", "+2.5e999"] {
            let reason = checked_value(text).expect_err(text);
            assert!(reason.contains(text) && reason.contains("range"), "{reason}");
        }
        for text in ["1e400 m", "inf", "'1e400'", "e400", "1e308"] {
            assert!(checked_value(text).is_ok(), "{text}");
        }
    }

    #[test]
    fn types_have_the_words_of_toml() {
        for (serde, toml) in [
            (
                "invalid type: integer `3`, expected a map",
                "invalid type: integer `3`, expected a table",
            ),
            (
                "invalid type: sequence, expected a map",
                "invalid type: list, expected a table",
            ),
        ] {
            assert_eq!(in_words_of_toml(serde), toml);
        }
    }

    #[test]
    fn checked_value_rejects_brackets_that_are_not_toml() {
        for text in ["{ position = 1e400 }", "[1, 2", "[1, 1e400]", "{ a = }", "[draft]"] {
            let read = checked_value(text);
            if text.ends_with([']', '}']) {
                let reason = read.expect_err(text);
                assert!(reason.contains(text) && reason.contains("is not TOML"), "{reason}");
            } else {
                assert_eq!(read, Ok(Value::String(text.to_owned())));
            }
        }
        for (text, kind) in [
            ("{ a = 1 }", "table"),
            ("[1, 2]", "array"),
            ("[1, 2] mm", "string"),
            ("10 ms", "string"),
        ] {
            assert_eq!(checked_value(text).expect(text).type_str(), kind, "{text}");
        }
    }
}
