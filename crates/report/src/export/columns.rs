//! A stream as a table: one column per element.

use lockstep::port::{Element, Field};

use tape::StreamSpec;

/// A column of a table.
pub(super) struct Column<'a> {
    /// The element with its unit: `p_NB_N[0] [m]`.
    pub(super) name: String,
    pub(super) field: &'a Field,
    /// Where the element starts in the payload, bytes.
    pub(super) start: usize,
}

/// The name of the first column, the stamp.
pub(super) const TIME: &str = "t [s]";

/// The columns of a stream after the stamp.
pub(super) fn columns(spec: &StreamSpec) -> Vec<Column<'_>> {
    let mut columns = Vec::new();
    for field in &spec.descriptor.fields {
        for element in 0..field.len() {
            columns.push(Column {
                name: format!("{} [{}]", field.element_name(element), field.unit),
                field,
                start: field.offset as usize + element * field.element.size(),
            });
        }
    }
    columns
}

/// One element in its own type.
#[derive(Debug, Clone, Copy)]
pub(super) enum Number {
    F64(f64),
    F32(f32),
    I64(i64),
    U64(u64),
}

/// Reads an element that starts at `start`.
pub(super) fn number(element: Element, payload: &[u8], start: usize) -> Number {
    macro_rules! raw {
        ($type:ty) => {{
            let mut raw = [0; size_of::<$type>()];
            raw.copy_from_slice(&payload[start..start + size_of::<$type>()]);
            <$type>::from_le_bytes(raw)
        }};
    }
    match element {
        Element::F64 => Number::F64(raw!(f64)),
        Element::F32 => Number::F32(raw!(f32)),
        Element::I64 => Number::I64(raw!(i64)),
        Element::I32 => Number::I64(i64::from(raw!(i32))),
        Element::U64 => Number::U64(raw!(u64)),
        Element::U32 => Number::U64(u64::from(raw!(u32))),
        Element::U8 => Number::U64(u64::from(payload[start])),
    }
}
