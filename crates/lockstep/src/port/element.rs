//! The element types of fields.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The element type of a field. Every one is little-endian and naturally aligned; texts and bytes have no alignment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Element {
    /// IEEE 754 double.
    F64,
    /// IEEE 754 single.
    F32,
    /// Signed 64-bit integer.
    I64,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 64-bit integer.
    U64,
    /// Unsigned 32-bit integer.
    U32,
    /// Unsigned byte.
    U8,
    /// Signed byte.
    I8,
    /// Signed 16-bit integer.
    I16,
    /// Unsigned 16-bit integer.
    U16,
    /// Truth value: one byte, 0 or 1.
    Bool,
    /// Enumeration: one byte, one of the named values of the field.
    Enum,
    /// Text of at most so many bytes: UTF-8, padded with zeros.
    Text(u32),
    /// At most so many bytes: their number (32 bits), then the bytes, padded with zeros.
    Bytes(u32),
}

impl Element {
    /// Size, bytes.
    pub const fn size(self) -> usize {
        match self {
            Element::F64 | Element::I64 | Element::U64 => 8,
            Element::F32 | Element::I32 | Element::U32 => 4,
            Element::I16 | Element::U16 => 2,
            Element::U8 | Element::I8 | Element::Bool | Element::Enum => 1,
            Element::Text(room) => room as usize,
            Element::Bytes(room) => 4 + room as usize,
        }
    }

    /// The alignment of its offset, bytes.
    pub const fn align(self) -> usize {
        match self {
            Element::Text(_) | Element::Bytes(_) => 1,
            other => other.size(),
        }
    }

    /// The name used in files: `f64`, `u8`, `bool`, … Texts and bytes are displayed with their room after it: `text[64]`.
    pub const fn name(self) -> &'static str {
        match self {
            Element::F64 => "f64",
            Element::F32 => "f32",
            Element::I64 => "i64",
            Element::I32 => "i32",
            Element::U64 => "u64",
            Element::U32 => "u32",
            Element::U8 => "u8",
            Element::I8 => "i8",
            Element::I16 => "i16",
            Element::U16 => "u16",
            Element::Bool => "bool",
            Element::Enum => "enum",
            Element::Text(_) => "text",
            Element::Bytes(_) => "bytes",
        }
    }

    /// Whether it is a floating-point number.
    pub const fn is_float(self) -> bool {
        matches!(self, Element::F64 | Element::F32)
    }

    /// Whether it is a number, for which arithmetic makes sense: not a truth value, enumeration, text or bytes.
    pub const fn is_number(self) -> bool {
        !matches!(self, Element::Bool | Element::Enum) && self.room().is_none()
    }

    /// The least and the largest value of an integer type; `None` for floating-point numbers.
    pub const fn range(self) -> Option<(i128, i128)> {
        Some(match self {
            Element::F64 | Element::F32 => return None,
            Element::I64 => (i64::MIN as i128, i64::MAX as i128),
            Element::I32 => (i32::MIN as i128, i32::MAX as i128),
            Element::I16 => (i16::MIN as i128, i16::MAX as i128),
            Element::I8 => (i8::MIN as i128, i8::MAX as i128),
            Element::U64 => (0, u64::MAX as i128),
            Element::U32 => (0, u32::MAX as i128),
            Element::U16 => (0, u16::MAX as i128),
            Element::U8 | Element::Enum => (0, u8::MAX as i128),
            Element::Bool => (0, 1),
            Element::Text(_) | Element::Bytes(_) => (0, 0),
        })
    }

    /// Whether every value of an `other` is also a value of this type. A truth value and a value of an enumeration are integers that
    /// other types hold; no number is valid as one of them. Whether two enumerations name the same values is checked for their fields. A
    /// text holds texts with no more room, and bytes hold bytes likewise.
    pub fn holds(self, other: Element) -> bool {
        let within =
            |(low, high): (i128, i128)| other.range().is_some_and(|(least, most)| low <= least && most <= high);
        match self {
            Element::Text(room) => matches!(other, Element::Text(least) if least <= room),
            Element::Bytes(room) => matches!(other, Element::Bytes(least) if least <= room),
            _ if other.room().is_some() => false,
            Element::Bool | Element::Enum => other == self,
            Element::F64 => other.is_float() || within((-(1 << 53), 1 << 53)),
            Element::F32 => other == Element::F32 || within((-(1 << 24), 1 << 24)),
            _ => self.range().is_some_and(within),
        }
    }

    /// One element of an integer type, exactly; 0 for texts and bytes. `bytes` starts at the element.
    pub fn to_integer(self, bytes: &[u8]) -> i128 {
        if self.room().is_some() {
            return 0;
        }
        let size = self.size();
        let signed = self.range().is_some_and(|(least, _)| least < 0);
        let fill = if signed && bytes[size - 1] & 0x80 != 0 { 0xff } else { 0 };
        let mut wide = [fill; 16];
        wide[..size].copy_from_slice(&bytes[..size]);
        i128::from_le_bytes(wide)
    }

    /// One element of this type as a double. Integers beyond 2^53 are rounded; for a text or bytes, a number that is the same for equal
    /// contents, and 0 for empty ones. `bytes` starts at the element.
    pub fn to_f64(self, bytes: &[u8]) -> f64 {
        macro_rules! read {
            ($type:ty) => {{
                let mut raw = [0; size_of::<$type>()];
                raw.copy_from_slice(&bytes[..size_of::<$type>()]);
                <$type>::from_le_bytes(raw) as f64
            }};
        }
        match self {
            Element::F64 => read!(f64),
            Element::F32 => read!(f32),
            Element::I64 => read!(i64),
            Element::I32 => read!(i32),
            Element::U64 => read!(u64),
            Element::U32 => read!(u32),
            Element::I16 => read!(i16),
            Element::U16 => read!(u16),
            Element::I8 => read!(i8),
            Element::U8 | Element::Bool | Element::Enum => f64::from(bytes[0]),
            Element::Text(_) | Element::Bytes(_) => self.fingerprint(bytes),
        }
    }

    /// Writes a double to the bytes of an element: integers take the nearest value that they can hold (NaN becomes zero). A truth value
    /// or an enumeration takes the byte, which the caller has ensured to be one of its values. A text or bytes cannot hold a double and
    /// become empty.
    pub fn put(self, value: f64, bytes: &mut [u8]) {
        let whole = value.round_ties_even();
        match self {
            Element::F64 => bytes.copy_from_slice(&value.to_le_bytes()),
            Element::F32 => bytes.copy_from_slice(&(value as f32).to_le_bytes()),
            Element::I64 => bytes.copy_from_slice(&(whole as i64).to_le_bytes()),
            Element::I32 => bytes.copy_from_slice(&(whole as i32).to_le_bytes()),
            Element::U64 => bytes.copy_from_slice(&(whole as u64).to_le_bytes()),
            Element::U32 => bytes.copy_from_slice(&(whole as u32).to_le_bytes()),
            Element::I16 => bytes.copy_from_slice(&(whole as i16).to_le_bytes()),
            Element::U16 => bytes.copy_from_slice(&(whole as u16).to_le_bytes()),
            Element::I8 => bytes.copy_from_slice(&(whole as i8).to_le_bytes()),
            Element::U8 | Element::Bool | Element::Enum => bytes.copy_from_slice(&[whole as u8]),
            Element::Text(_) | Element::Bytes(_) => bytes.fill(0),
        }
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.room().map_or(Ok(()), |room| write!(f, "[{room}]"))
    }
}
