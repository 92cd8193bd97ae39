//! Tabular layout of a stream: a column per element, or one for a whole field that is too wide.

use std::collections::HashSet;

use lockstep::port::{Content, Descriptor, Element, Field};

use tape::StreamSpec;

/// A field with more elements than this is one column. A picture has a million elements, and no reader opens a table with a
/// million columns; the largest matrices that users inspect element by element (a covariance of 16 states) stay below.
pub(super) const WIDEST: usize = 256;

/// A column of a table.
pub(super) struct Column<'a> {
    /// The element with its unit: `p_NB_N[0] [m]`. Column names are unique.
    pub(super) name: String,
    pub(super) field: &'a Field,
    /// Where the column starts in the payload, bytes.
    pub(super) start: usize,
    /// The number of elements in each cell: one, or all of a wide field.
    pub(super) elements: usize,
}

impl Column<'_> {
    /// Whether each cell holds the whole field.
    pub(super) fn is_wide(&self) -> bool {
        self.elements > 1
    }

    /// The name of the enumeration value in the cell.
    pub(super) fn name_in(&self, payload: &[u8]) -> Option<&str> {
        self.field.name_of(self.field.element.to_f64(&payload[self.start..]))
    }

    /// The text or the bytes in the cell, as text for tables: bytes in hexadecimal.
    pub(super) fn content_in(&self, payload: &[u8]) -> Option<String> {
        Some(match self.field.element.content(&payload[self.start..]).ok()? {
            Content::Text(text) => text.to_owned(),
            Content::Bytes(bytes) => bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
        })
    }

    /// The bytes of the cell.
    pub(super) fn cell<'p>(&self, payload: &'p [u8]) -> &'p [u8] {
        &payload[self.start..self.start + self.elements * self.field.element.size()]
    }
}

/// Whether the field is stored as one column.
pub(super) fn is_wide(field: &Field) -> bool {
    field.len() > WIDEST
}

/// The name of the first column, the stamp.
pub(super) const TIME: &str = "t [s]";

/// The fields of a stream that are exported: all but padding, which has no meaning.
pub(super) fn fields(spec: &StreamSpec) -> impl Iterator<Item = &Field> {
    spec.descriptor.fields.iter().filter(|field| !field.is_padding())
}

/// The descriptor of a stream with only the fields that are exported.
pub(super) fn descriptor(spec: &StreamSpec) -> Descriptor {
    Descriptor {
        fields: fields(spec).cloned().collect(),
        ..spec.descriptor.clone()
    }
}

/// The columns of a stream after the stamp.
pub(super) fn columns(spec: &StreamSpec) -> Vec<Column<'_>> {
    let mut columns = Vec::new();
    let mut names = vec![("t".to_owned(), "s")];
    for field in fields(spec) {
        // Names and truth values have no unit.
        let unit = if field.element.is_number() {
            field.unit.as_str()
        } else {
            ""
        };
        let start = field.offset as usize;
        if is_wide(field) {
            names.push((field.name.clone(), unit));
            columns.push(Column {
                name: String::new(),
                field,
                start,
                elements: field.len(),
            });
            continue;
        }
        for element in 0..field.len() {
            names.push((field.element_name(element), unit));
            columns.push(Column {
                name: String::new(),
                field,
                start: start + element * field.element.size(),
                elements: 1,
            });
        }
    }
    // The stamp comes first, so it keeps its name whatever the fields are called.
    for (column, name) in columns.iter_mut().zip(headings(&names).into_iter().skip(1)) {
        column.name = name;
    }
    columns
}

/// A name with its unit, as a column heading; without a unit the name alone.
pub(super) fn heading(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} [{unit}]")
    }
}

/// Names with their units as unique headings: `t_2 [s]` where `t [s]` already exists.
pub(super) fn headings(columns: &[(String, &str)]) -> Vec<String> {
    let wanted = columns.iter().map(|(name, unit)| heading(name, unit)).collect();
    distinct(wanted, |at, n| {
        heading(&format!("{}_{n}", columns[at].0), columns[at].1)
    })
}

/// Makes names unique. The first of several equal ones is unchanged; for the others, at position `at`, `another(at, n)`
/// returns names to try, n = 2, 3, …
pub(super) fn distinct(wanted: Vec<String>, another: impl Fn(usize, usize) -> String) -> Vec<String> {
    let mut taken: HashSet<String> = HashSet::new();
    let repeated: Vec<bool> = wanted.iter().map(|name| !taken.insert(name.clone())).collect();
    // All wanted names are reserved first: no generated name takes a name that another column already has.
    let named = wanted.into_iter().zip(repeated).enumerate();
    named
        .map(|(at, (name, repeated))| {
            if !repeated {
                return name;
            }
            let mut n = 2;
            loop {
                let name = another(at, n);
                if taken.insert(name.clone()) {
                    return name;
                }
                n += 1;
            }
        })
        .collect()
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
        Element::I16 => Number::I64(i64::from(raw!(i16))),
        Element::I8 => Number::I64(i64::from(raw!(i8))),
        Element::U16 => Number::U64(u64::from(raw!(u16))),
        Element::U8 | Element::Bool | Element::Enum => Number::U64(u64::from(payload[start])),
        // Never requested: tables store the content of texts and bytes.
        Element::Text(_) | Element::Bytes(_) => Number::U64(0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn headings_are_unique_and_first_of_equals_is_unchanged(
            names in prop::collection::vec(("[ta_]{1,2}(_2|_3)?(\\[0\\])?", prop::sample::select(vec!["s", "m", ""])), 0..40),
        ) {
            let made = headings(&names);
            let different: HashSet<&String> = made.iter().collect();
            prop_assert_eq!(different.len(), names.len());
            let mut seen = HashSet::new();
            for ((name, unit), made) in names.iter().zip(&made) {
                let wanted = heading(name, unit);
                if seen.insert(wanted.clone()) {
                    prop_assert_eq!(made, &wanted);
                } else {
                    prop_assert!(made.starts_with(&format!("{name}_")), "{} for {}", made, wanted);
                }
            }
        }
    }
}
