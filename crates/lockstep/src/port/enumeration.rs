//! Enumerations: one byte with named values.

use serde::{Deserialize, Serialize};

use super::Element;

/// A value of an enumeration, and its name.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnumValue {
    /// The name, unique in the enumeration.
    pub name: String,
    /// The byte, unique in the enumeration.
    pub value: u8,
}

impl EnumValue {
    /// Characters that no name contains: they separate the entries where a list of names is given as text.
    pub const SEPARATORS: [char; 3] = ['|', ',', '='];

    /// A value with its name.
    pub fn new(name: impl Into<String>, value: u8) -> EnumValue {
        EnumValue {
            name: name.into(),
            value,
        }
    }

    /// Parses a list of values: `closed = 0, opening = 1, open = 2`.
    ///
    /// # Errors
    /// The part that does not have this form.
    pub fn list(text: &str) -> Result<Vec<EnumValue>, String> {
        let each = text.split(',').map(|part| {
            let pair = part
                .split_once('=')
                .map(|(name, value)| (name.trim(), value.trim().parse()));
            match pair {
                Some((name, Ok(value))) => Ok(EnumValue::new(name, value)),
                _ => Err(format!(
                    "`{}` is not a value of an enumeration: write `NAME = BYTE`, such as `closed = 0, open = 1`",
                    part.trim()
                )),
            }
        });
        each.collect()
    }
}

/// A value that is not valid for its element type.
#[derive(Debug, Clone, PartialEq)]
pub struct InvalidValue {
    /// The element of the payload.
    pub element: String,
    /// Its value.
    pub value: f64,
    /// What the type allows; `None` for floating-point numbers, which must be finite.
    allowed: Option<String>,
    /// Whether the element is a text or bytes, so that `value` is meaningless.
    content: bool,
}

impl InvalidValue {
    /// The element called `name`, of the type `element`, which has `values` if it is an enumeration.
    pub(super) fn new(name: String, element: Element, values: &[EnumValue], value: f64) -> InvalidValue {
        let allowed = match element {
            Element::Bool => Some("a bool is 0 or 1".to_owned()),
            Element::Enum => Some(format!("its values are {}", describe_values(values))),
            _ => None,
        };
        InvalidValue {
            element: name,
            value,
            allowed,
            content: false,
        }
    }

    /// The element called `name`, a text or bytes, with what is wrong with its content.
    pub(super) fn of_content(name: String, reason: String) -> InvalidValue {
        InvalidValue {
            element: name,
            value: f64::NAN,
            allowed: Some(reason),
            content: true,
        }
    }

    /// Whether it is a floating-point number.
    pub fn is_number(&self) -> bool {
        self.allowed.is_none()
    }

    /// `q = NaN: a sample must be finite`, `open = 2: a bool is 0 or 1`; `what` names what must be finite.
    pub fn describe(&self, what: &str) -> String {
        let rule = match &self.allowed {
            Some(allowed) => allowed.clone(),
            None => format!("{what} must be finite"),
        };
        if self.content {
            return format!("{}: {rule}", self.element);
        }
        format!("{} = {}: {rule}", self.element, self.value)
    }
}

/// `closed (0), open (1)`
pub(super) fn describe_values(values: &[EnumValue]) -> String {
    let each: Vec<String> = (values.iter())
        .map(|named| format!("{} ({})", named.name, named.value))
        .collect();
    each.join(", ")
}

/// The part after the offset in the text that is hashed.
pub(super) fn canonical(values: &[EnumValue]) -> String {
    let each: Vec<String> = (values.iter())
        .map(|named| format!("{}={}", named.value, named.name))
        .collect();
    match each[..] {
        [] => String::new(),
        _ => format!("|{}", each.join(",")),
    }
}

/// What is wrong with the values and the unit of a field, which may come from a foreign participant.
pub(super) fn find_error(element: Element, unit: &str, values: &[EnumValue]) -> Option<&'static str> {
    if !element.is_number() && unit != "1" {
        return Some("a bool, an enumeration, a text and bytes have no unit: write 1");
    }
    if element != Element::Enum {
        return (!values.is_empty()).then_some("only an enumeration has named values");
    }
    let odd = |character: char| character.is_control() || EnumValue::SEPARATORS.contains(&character);
    if values
        .iter()
        .any(|named| named.name.trim().is_empty() || named.name.contains(odd))
    {
        return Some("a value of an enumeration needs a name, without `|`, `,` and `=`");
    }
    let twice = values.iter().enumerate().any(|(at, named)| {
        let before = &values[..at];
        before
            .iter()
            .any(|other| other.name == named.name || other.value == named.value)
    });
    if twice {
        return Some("two values of the enumeration have the same name or the same byte");
    }
    let zero = values.iter().any(|named| named.value == 0);
    (!zero).then_some("an enumeration needs a name for 0, which an input shows before its first sample")
}
