//! The types of variables, and the conversion of values between a payload and a caller.

use lockstep::port::Element;

use crate::refusal::Refusal;

/// The version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// The type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VariableKind {
    /// Numbers as stored in a payload.
    Number(Element),
    /// A truth value, one byte.
    Boolean,
    /// An enumeration, one byte: the standard's functions use an Integer (FMI 2.0) or an Int64 (FMI 3.0) for it.
    Enumeration,
    /// A text that is a parameter.
    Text,
    /// A text or bytes in a payload, with their capacity.
    Content(Element),
}

/// The type of a caller's values: one get and one set function of the standard for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Native {
    Float64,
    Float32,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    /// A byte (FMI 3.0).
    Boolean8,
    /// An int (FMI 2.0).
    Boolean32,
    Text,
    /// FMI 3.0.
    Binary,
}

impl Native {
    /// Bytes of one value.
    pub fn size(self) -> usize {
        match self {
            Native::Float64 | Native::Int64 | Native::UInt64 | Native::Text | Native::Binary => 8,
            Native::Float32 | Native::Int32 | Native::UInt32 | Native::Boolean32 => 4,
            Native::Int16 | Native::UInt16 => 2,
            Native::Int8 | Native::UInt8 | Native::Boolean8 => 1,
        }
    }
}

impl VariableKind {
    /// Bytes of one stored element.
    pub fn size(self) -> usize {
        match self {
            VariableKind::Number(element) => element.size(),
            VariableKind::Boolean | VariableKind::Enumeration => 1,
            VariableKind::Text => 0,
            VariableKind::Content(element) => element.size(),
        }
    }

    /// Whether it is a floating-point number.
    pub fn is_float(self) -> bool {
        matches!(self, VariableKind::Number(Element::F64 | Element::F32))
    }

    /// The type of the function that gets and sets it.
    pub fn native(self, version: Version) -> Native {
        match (version, self) {
            (_, VariableKind::Text | VariableKind::Content(Element::Text(_))) => Native::Text,
            // FMI 2.0 has none: ports with bytes are not exported to it.
            (_, VariableKind::Content(_)) => Native::Binary,
            (Version::Fmi2, VariableKind::Number(Element::F64 | Element::F32)) => Native::Float64,
            (Version::Fmi2, VariableKind::Number(_) | VariableKind::Enumeration) => Native::Int32,
            (Version::Fmi3, VariableKind::Enumeration) => Native::Int64,
            (Version::Fmi2, VariableKind::Boolean) => Native::Boolean32,
            (Version::Fmi3, VariableKind::Boolean) => Native::Boolean8,
            (Version::Fmi3, VariableKind::Number(element)) => match element {
                Element::F64 => Native::Float64,
                Element::F32 => Native::Float32,
                Element::I64 => Native::Int64,
                Element::I32 => Native::Int32,
                Element::U64 => Native::UInt64,
                Element::U32 => Native::UInt32,
                Element::I16 => Native::Int16,
                Element::U16 => Native::UInt16,
                Element::I8 => Native::Int8,
                // Non-numeric fields have kinds of their own.
                _ => Native::UInt8,
            },
        }
    }

    /// The type of a field's elements.
    pub fn of(element: Element) -> VariableKind {
        match element {
            Element::Bool => VariableKind::Boolean,
            Element::Enum => VariableKind::Enumeration,
            Element::Text(_) | Element::Bytes(_) => VariableKind::Content(element),
            number => VariableKind::Number(number),
        }
    }

    /// The name of the type in a model description.
    pub fn name(self, version: Version) -> &'static str {
        if self == VariableKind::Enumeration {
            return "Enumeration";
        }
        match self.native(version) {
            Native::Float64 if version == Version::Fmi2 => "Real",
            Native::Int32 if version == Version::Fmi2 => "Integer",
            Native::Float64 => "Float64",
            Native::Float32 => "Float32",
            Native::Int8 => "Int8",
            Native::UInt8 => "UInt8",
            Native::Int16 => "Int16",
            Native::UInt16 => "UInt16",
            Native::Int32 => "Int32",
            Native::UInt32 => "UInt32",
            Native::Int64 => "Int64",
            Native::UInt64 => "UInt64",
            Native::Boolean8 | Native::Boolean32 => "Boolean",
            Native::Text => "String",
            Native::Binary => "Binary",
        }
    }

    /// Converts one element, at the start of `from`, to a caller's value.
    ///
    /// # Errors
    /// When the caller's type cannot hold a whole number.
    pub fn to_native(self, from: &[u8], native: Native, to: &mut [u8]) -> Result<(), Refusal> {
        let size = self.size();
        match (self, native) {
            (VariableKind::Number(Element::F32), Native::Float64) => {
                to.copy_from_slice(&Element::F32.to_f64(from).to_le_bytes());
            }
            (VariableKind::Enumeration, Native::Int32 | Native::Int64) => {
                to.fill(0);
                to[0] = from[0];
            }
            (VariableKind::Boolean, Native::Boolean32) => to.copy_from_slice(&i32::from(from[0] != 0).to_le_bytes()),
            (VariableKind::Number(element), Native::Int32) if element != Element::I32 => {
                let value = element.to_integer(from);
                let short = i32::try_from(value).map_err(|_| {
                    Refusal::error(format!(
                        "{value} does not fit into an Integer of FMI 2.0: export it for FMI 3.0"
                    ))
                })?;
                to.copy_from_slice(&short.to_le_bytes());
            }
            _ => to.copy_from_slice(&from[..size]),
        }
        Ok(())
    }

    /// Converts a caller's value to an element, at the start of `to`.
    ///
    /// # Errors
    /// A number that is not finite, or does not fit into the element.
    pub fn element_from_native(self, from: &[u8], native: Native, to: &mut [u8]) -> Result<(), Refusal> {
        if let (true, Native::Float64 | Native::Float32) = (self.is_float(), native) {
            let element = if native == Native::Float64 {
                Element::F64
            } else {
                Element::F32
            };
            let value = element.to_f64(from);
            let small = self == VariableKind::Number(Element::F32) && value.abs() > f64::from(f32::MAX);
            if !value.is_finite() || small {
                return Err(Refusal::discard(format!(
                    "cannot be set to {value}: a value must be finite"
                )));
            }
        }
        let size = self.size();
        match (self, native) {
            (VariableKind::Number(Element::F32), Native::Float64) => {
                Element::F32.put(Element::F64.to_f64(from), &mut to[..size])
            }
            (VariableKind::Enumeration, Native::Int32 | Native::Int64) => {
                // The field checks which values are valid; a value above one byte is always invalid.
                if from[1..].iter().any(|byte| *byte != 0) {
                    let refused = "cannot be set to a number that is no item of its enumeration";
                    return Err(Refusal::discard(refused.to_owned()));
                }
                to[0] = from[0];
            }
            (VariableKind::Boolean, Native::Boolean32) => to[0] = u8::from(from.iter().any(|byte| *byte != 0)),
            (VariableKind::Boolean, Native::Boolean8) => to[0] = u8::from(from[0] != 0),
            (VariableKind::Number(element), Native::Int32) if element != Element::I32 => {
                let value = i128::from(i32::from_le_bytes([from[0], from[1], from[2], from[3]]));
                if element
                    .range()
                    .is_some_and(|(least, most)| !(least..=most).contains(&value))
                {
                    let text = format!("cannot be set to {value}: it is a {}", element.name());
                    return Err(Refusal::discard(text));
                }
                to[..size].copy_from_slice(&value.to_le_bytes()[..size]);
            }
            _ => to[..size].copy_from_slice(from),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integer_conversion_is_exact_or_refused() {
        let mut to = [0; 4];
        let give = |element: Element, bytes: &[u8], to: &mut [u8]| {
            VariableKind::Number(element).to_native(bytes, Native::Int32, to)
        };
        give(Element::I64, &(-7_i64).to_le_bytes(), &mut to).unwrap();
        assert_eq!(i32::from_le_bytes(to), -7);
        give(Element::U8, &[200], &mut to).unwrap();
        assert_eq!(i32::from_le_bytes(to), 200);
        assert!(give(Element::U32, &u32::MAX.to_le_bytes(), &mut to).is_err());
        let mut byte = [0];
        let take = |value: i32, to: &mut [u8]| {
            VariableKind::Number(Element::U8).element_from_native(&value.to_le_bytes(), Native::Int32, to)
        };
        take(255, &mut byte).unwrap();
        assert_eq!(byte, [255]);
        assert_eq!(
            take(256, &mut byte).unwrap_err().status,
            crate::refusal::Status::Discard
        );
        assert!(take(-1, &mut byte).is_err());
        let mut long = [0; 8];
        VariableKind::Number(Element::I64)
            .element_from_native(&(-2_i32).to_le_bytes(), Native::Int32, &mut long)
            .unwrap();
        assert_eq!(i64::from_le_bytes(long), -2);
    }

    #[test]
    fn non_finite_numbers_are_discarded() {
        let mut to = [0; 8];
        for (element, value) in [
            (Element::F64, f64::NAN),
            (Element::F64, f64::INFINITY),
            (Element::F32, 1e300),
        ] {
            let refused =
                VariableKind::Number(element).element_from_native(&value.to_le_bytes(), Native::Float64, &mut to);
            assert_eq!(refused.unwrap_err().status, crate::refusal::Status::Discard, "{value}");
        }
        VariableKind::Number(Element::F32)
            .element_from_native(&0.1_f64.to_le_bytes(), Native::Float64, &mut to)
            .unwrap();
        assert_eq!(to[..4], 0.1_f32.to_le_bytes());
    }
}
