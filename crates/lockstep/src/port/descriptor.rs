//! The description of a port's payload.

use std::collections::HashSet;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::enumeration::{self, EnumValue};
use super::{Element, InvalidValue};
use crate::name::{escape_controls, is_control_or_direction_mark};

/// What separates the parts of a descriptor's canonical text: two descriptors must never have the same text.
const SEPARATOR: char = '|';

/// One named field of a payload.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// The field's name, unique in the payload.
    pub name: String,
    /// The type of each element.
    pub element: Element,
    /// The extents, row-major; empty for a scalar.
    #[serde(default)]
    pub shape: Vec<u32>,
    /// The unit of every element, such as `N m` or `rad/s`; `1` for a dimensionless number.
    pub unit: String,
    /// The frame in which a vector's components are given; empty where a frame has no meaning.
    #[serde(default)]
    pub frame: String,
    /// The offset of the field, bytes.
    pub offset: u32,
    /// The values of an enumeration with their names; empty for every other type.
    #[serde(default)]
    pub values: Vec<EnumValue>,
}

impl Field {
    /// How many elements the field has.
    pub fn len(&self) -> usize {
        self.shape.iter().map(|&extent| extent as usize).product()
    }

    /// True when an extent is zero.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether the field is padding: bytes called `padding`, `padding2`, `padding_2`, … have no meaning, need not be fed, and are not
    /// exported.
    pub fn is_padding(&self) -> bool {
        let number = self.name.strip_prefix("padding");
        let number = number.map(|rest| rest.strip_prefix('_').unwrap_or(rest));
        self.element == Element::U8 && number.is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()))
    }

    /// The bytes of the field inside a payload.
    pub fn range(&self) -> std::ops::Range<usize> {
        let start = self.offset as usize;
        start..start + self.len() * self.element.size()
    }

    /// The offset of element `index` in a payload.
    fn start(&self, index: usize) -> usize {
        self.offset as usize + index * self.element.size()
    }

    /// Element `index` of the field of `payload` as a double.
    pub fn value(&self, payload: &[u8], index: usize) -> f64 {
        self.element.to_f64(&payload[self.start(index)..])
    }

    /// Whether `value` is valid for an element: finite, 0 or 1 for a truth value, one with a name for an enumeration.
    pub fn allows(&self, value: f64) -> bool {
        match self.element {
            Element::Bool => value == 0.0 || value == 1.0,
            Element::Enum => self.values.iter().any(|named| f64::from(named.value) == value),
            _ => value.is_finite(),
        }
    }

    /// Refuses a name, unit or frame with a control character, since they appear in messages, file names and pages, and with the separator
    /// of a descriptor's canonical text.
    fn check_texts(&self, message: &str) -> Result<(), DescriptorError> {
        for (what, text) in [("name", &self.name), ("unit", &self.unit), ("frame", &self.frame)] {
            let controls = text.contains(is_control_or_direction_mark);
            if !controls && !text.contains(SEPARATOR) {
                continue;
            }
            let message = message.to_owned();
            let name = escape_controls(&self.name);
            let text = format!("field `{name}`: its {what} `{}`", escape_controls(text));
            return Err(if controls {
                DescriptorError::Text { message, text }
            } else {
                DescriptorError::Separator { message, text }
            });
        }
        Ok(())
    }

    /// What is wrong with element `index` of `payload`, if anything is: a number that is not finite, a truth value that is neither 0 nor 1,
    /// a value of an enumeration that has no name, a text that is not UTF-8, a length beyond the room.
    fn invalid_element(&self, payload: &[u8], index: usize) -> Option<InvalidValue> {
        if self.element.room().is_some() {
            let content = self.element.content(&payload[self.start(index)..]);
            return content
                .err()
                .map(|reason| InvalidValue::of_content(self.element_name(index), reason));
        }
        let value = self.value(payload, index);
        (!self.allows(value)).then(|| InvalidValue::new(self.element_name(index), self.element, &self.values, value))
    }

    /// Element `index` of `payload` as text: `0.5`, `open`, `"ready"`.
    pub fn shown(&self, payload: &[u8], index: usize) -> String {
        let value = self.value(payload, index);
        match (self.name_of(value), self.element.content(&payload[self.start(index)..])) {
            (Some(name), _) => name.to_owned(),
            (None, Ok(content)) => content.to_string(),
            (None, Err(reason)) if self.element.room().is_some() => reason,
            (None, Err(_)) => value.to_string(),
        }
    }

    /// The name of `value` in an enumeration; `None` for other types and for values without a name.
    pub fn name_of(&self, value: f64) -> Option<&str> {
        let named = self.values.iter().find(|named| f64::from(named.value) == value);
        named.map(|named| named.name.as_str())
    }

    /// The name of an element for tables: `p_NB_N[0]`, or just the field's name for a scalar.
    pub fn element_name(&self, index: usize) -> String {
        if self.shape.is_empty() {
            return self.name.clone();
        }
        let mut rest = index;
        let mut text = String::new();
        for &extent in self.shape.iter().rev() {
            text = format!("[{}]{text}", rest % extent as usize);
            rest /= extent as usize;
        }
        format!("{}{text}", self.name)
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.element)?;
        if !self.shape.is_empty() {
            write!(f, "{:?}", self.shape)?;
        }
        if !self.values.is_empty() {
            write!(f, " of {}", enumeration::describe_values(&self.values))?;
        }
        if self.element.is_number() {
            write!(f, " in {}", self.unit)?;
        }
        if !self.frame.is_empty() {
            write!(f, ", frame {}", self.frame)?;
        }
        Ok(())
    }
}

/// The description of a payload: plain old data in C layout, without padding.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Descriptor {
    /// The name of the message type.
    pub name: String,
    /// The size of a payload, bytes; a multiple of the largest element.
    pub size: u32,
    /// The fields in the order of their offsets.
    pub fields: Vec<Field>,
}

/// Why a descriptor cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DescriptorError {
    /// A payload must not be empty, and has at most [`Descriptor::MAX_SIZE`].
    #[error("message `{message}`: a payload of {size} bytes; between 1 and {max} are allowed", max = Descriptor::MAX_SIZE)]
    Size {
        /// The message.
        message: String,
        /// Its size, bytes.
        size: u64,
    },
    /// The name of a message that would steer what shows it.
    #[error("message `{message}`: its name has a control character in it: leave the character out")]
    Name {
        /// The message, with the code point of the character.
        message: String,
    },
    /// A name, unit or frame with the separator of a descriptor's canonical text.
    #[error(
        "message `{message}`, {text} has `|` in it, which separates the parts of a descriptor: choose another name, or ports without it"
    )]
    Separator {
        /// The message.
        message: String,
        /// The text.
        text: String,
    },
    /// The name, unit or frame of a field would steer what shows it.
    #[error("message `{message}`, {text} has a control character in it: leave the character out")]
    Text {
        /// The message.
        message: String,
        /// Which text of which field, with the code points of such characters.
        text: String,
    },
    /// A field is unnamed, repeated, empty, misaligned, overlapping or beyond the end.
    #[error("message `{message}`, field `{field}`: {reason}")]
    Field {
        /// The message.
        message: String,
        /// The field.
        field: String,
        /// What is wrong with it.
        reason: &'static str,
    },
}

impl Descriptor {
    /// The largest payload, bytes: an image, a point cloud.
    pub const MAX_SIZE: u32 = 64 << 20;
    /// The largest payload that is assembled from fields, bytes. A larger one is connected as a whole, and its zeros are not stored where
    /// it is all zeros.
    pub const PARTS_MAX: u32 = 1 << 20;

    /// Checks the descriptor that a foreign participant reports, so that later code can rely on every offset.
    pub fn validate(&self) -> Result<(), DescriptorError> {
        if self.name.contains(is_control_or_direction_mark) {
            let message = escape_controls(&self.name);
            return Err(DescriptorError::Name { message });
        }
        if self.name.contains(SEPARATOR) {
            let (message, text) = (self.name.clone(), format!("its name `{}`", self.name));
            return Err(DescriptorError::Separator { message, text });
        }
        if self.size == 0 || self.size > Self::MAX_SIZE {
            return Err(DescriptorError::Size {
                message: self.name.clone(),
                size: u64::from(self.size),
            });
        }
        let mut end = 0_u64;
        let mut names = HashSet::new();
        for field in &self.fields {
            let refuse = |reason| {
                Err(DescriptorError::Field {
                    message: self.name.clone(),
                    field: escape_controls(&field.name),
                    reason,
                })
            };
            field.check_texts(&self.name)?;
            if field.name.is_empty() {
                return refuse("a field needs a name");
            }
            if !names.insert(field.name.as_str()) {
                return refuse("the name is used twice");
            }
            let count = field
                .shape
                .iter()
                .try_fold(1_u64, |product, &extent| product.checked_mul(u64::from(extent)));
            let bytes = match count.and_then(|count| count.checked_mul(field.element.size() as u64)) {
                None => return refuse("the shape is too large"),
                Some(0) if field.element.size() > 0 => return refuse("the shape has a zero in it"),
                Some(bytes) => bytes,
            };
            if let Some(reason) = enumeration::find_error(field.element, &field.unit, &field.values) {
                return refuse(reason);
            }
            if field.element.room() == Some(0) || bytes > u64::from(Self::MAX_SIZE) && field.element.room().is_some() {
                return refuse("a text or bytes need room for 1 byte at least, and for no more than a payload has");
            }
            if !u64::from(field.offset).is_multiple_of(field.element.align() as u64) {
                return refuse("the offset is not a multiple of the element's size");
            }
            if u64::from(field.offset) != end {
                return refuse("it does not start where the field before it ends");
            }
            end = match end.checked_add(bytes) {
                Some(end) if end <= u64::from(self.size) => end,
                _ => return refuse("it reaches beyond the end of the payload"),
            };
        }
        if end != u64::from(self.size) {
            return Err(DescriptorError::Field {
                message: self.name.clone(),
                field: String::new(),
                reason: "the fields do not fill the payload; padding must be a field of its own",
            });
        }
        Ok(())
    }

    /// The field called `name`.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name == name)
    }

    /// Resolves `name`: a field (`q`) or one of its elements (`q[3]`, `R[0][2]`), with the selected elements, row-major. `None` when
    /// the payload has nothing of that name.
    pub fn resolve(&self, name: &str) -> Option<(&Field, std::ops::Range<usize>)> {
        if let Some(field) = self.field(name) {
            return Some((field, 0..field.len()));
        }
        let field = self.field(name.split('[').next()?)?;
        let mut rest = &name[field.name.len()..];
        let mut index = 0;
        for &extent in &field.shape {
            let (digits, behind) = rest.strip_prefix('[')?.split_once(']')?;
            let at: u32 = digits.parse().ok()?;
            // An element has only one name: no sign, no leading zeros.
            if at >= extent || at.to_string() != digits {
                return None;
            }
            index = index * extent as usize + at as usize;
            rest = behind;
        }
        (rest.is_empty() && !field.shape.is_empty()).then_some((field, index..index + 1))
    }

    /// A 64-bit FNV-1a hash of names, types, shapes, units, frames and offsets. Equal descriptors have equal hashes on every machine and
    /// in every language; the text that is hashed has one line per field, as [`Descriptor::canonical`] returns it.
    pub fn hash64(&self) -> u64 {
        crate::fnv::fnv1a(self.canonical())
    }

    /// The text behind [`Descriptor::hash64`]: `name size\n`, then `name|element|extents|unit|frame|offset\n` per field; that of an
    /// enumeration continues after the offset: `|0=closed,1=open\n`.
    pub fn canonical(&self) -> String {
        let mut text = format!("{} {}\n", self.name, self.size);
        for field in &self.fields {
            let extents: Vec<String> = field.shape.iter().map(u32::to_string).collect();
            text += &format!(
                "{}|{}|{}|{}|{}|{}{}\n",
                field.name,
                field.element,
                extents.join(","),
                field.unit,
                field.frame,
                field.offset,
                enumeration::canonical(&field.values)
            );
        }
        text
    }

    /// The elements of `payload`, which has the size of this descriptor, that are not valid for their type: a number that is not finite,
    /// a truth value that is neither 0 nor 1, a value of an enumeration that has no name, a text that is not UTF-8, a length beyond the
    /// room.
    pub fn invalid(&self, payload: &[u8]) -> impl Iterator<Item = InvalidValue> {
        let elements = (self.fields.iter()).flat_map(|field| (0..field.len()).map(move |index| (field, index)));
        elements.filter_map(|(field, index)| field.invalid_element(payload, index))
    }

    /// Describes the first difference between two descriptors, for a user who connected the wrong ports.
    pub fn difference(&self, other: &Descriptor) -> Option<String> {
        if self == other {
            return None;
        }
        for (mine, theirs) in self.fields.iter().zip(&other.fields) {
            if mine != theirs {
                return Some(format!("`{mine}` against `{theirs}`"));
            }
        }
        if self.fields.len() != other.fields.len() {
            let (longer, extra) = if self.fields.len() > other.fields.len() {
                (&self.name, &self.fields[other.fields.len()])
            } else {
                (&other.name, &other.fields[self.fields.len()])
            };
            return Some(format!("only `{longer}` has the field `{extra}`"));
        }
        Some(format!(
            "message `{}` of {} bytes against `{}` of {}",
            self.name, self.size, other.name, other.size
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptor_resolves_each_element_by_one_name() {
        let field = |name: &str, shape: &[u32], offset: u32| Field {
            name: name.into(),
            element: Element::U8,
            shape: shape.to_vec(),
            unit: "1".into(),
            frame: String::new(),
            offset,
            values: Vec::new(),
        };
        let descriptor = Descriptor {
            name: "Message".into(),
            size: 31,
            fields: vec![
                field("cube", &[2, 3, 4], 0),
                field("row", &[6], 24),
                field("one", &[], 30),
            ],
        };
        assert_eq!(descriptor.validate(), Ok(()));
        for field in &descriptor.fields {
            for index in 0..field.len() {
                let found = descriptor.resolve(&field.element_name(index));
                assert_eq!(found, Some((field, index..index + 1)));
            }
            assert_eq!(descriptor.resolve(&field.name), Some((field, 0..field.len())));
        }
        for (name, element, padding) in [
            ("padding", Element::U8, true),
            ("padding2", Element::U8, true),
            ("padding_12", Element::U8, true),
            ("padding", Element::F64, false),
            ("padding_of", Element::U8, false),
            ("paddingCount", Element::U8, false),
        ] {
            let one = Field {
                element,
                ..field(name, &[], 0)
            };
            assert_eq!(one.is_padding(), padding, "{name}: {element}");
        }
        for name in [
            "row[6]",
            "row[00]",
            "row[+1]",
            "row[-1]",
            "row[ 1]",
            "row[1",
            "row[1]]",
            "row[1][0]",
            "row[]",
            "row[1]x",
            "cube[1][2]",
            "cube[1][2][4]",
            "one[0]",
            "two",
            "",
            "[0]",
            "row[99999999999]",
        ] {
            assert_eq!(descriptor.resolve(name), None, "{name}");
        }
    }
}
