//! The Arrow schema, from which Arrow readers get the metadata of each column: a flatbuffer `Message` with a `Schema` in
//! Arrow's encapsulated form (see the Arrow format specification, `Message.fbs` and `Schema.fbs`).

use lockstep::port::Element;

use crate::export::columns::{Column, TIME};

/// A value of a flatbuffer table.
enum Slot {
    Absent,
    Byte(u8),
    Short(i16),
    Int(i32),
    Text(String),
    Table(Vec<Slot>),
    Tables(Vec<Vec<Slot>>),
}

/// The encapsulated schema message.
pub(super) fn schema(columns: &[Column<'_>]) -> Vec<u8> {
    const VERSION_5: i16 = 4;
    const HEADER_IS_SCHEMA: u8 = 1;
    let mut fields = vec![field(
        TIME,
        number(Element::F64),
        Vec::new(),
        &[("unit", "s".to_owned())],
    )];
    for column in columns {
        let described = column.field;
        let mut metadata = vec![("unit", described.unit.clone()), ("field", described.name.clone())];
        if !described.frame.is_empty() {
            metadata.push(("frame", described.frame.clone()));
        }
        if column.is_wide() {
            metadata.push(("shape", format!("{:?}", described.shape)));
        }
        let (kind, children) = cell(column);
        fields.push(field(&column.name, kind, children, &metadata));
    }
    let schema = vec![Slot::Absent, Slot::Tables(fields)];
    let message = vec![
        Slot::Short(VERSION_5),
        Slot::Byte(HEADER_IS_SCHEMA),
        Slot::Table(schema),
    ];
    let mut buffer = vec![0; 4];
    let root = table(&mut buffer, &message);
    buffer[..4].copy_from_slice(&root.to_le_bytes());
    align(&mut buffer, 8);
    let mut out = 0xffff_ffff_u32.to_le_bytes().to_vec();
    out.extend((buffer.len() as i32).to_le_bytes());
    out.extend(buffer);
    out
}

/// A type: its number in the union of types, and its details.
type Type = (u8, Vec<Slot>);

fn number(element: Element) -> Type {
    const INT: u8 = 2;
    const FLOAT: u8 = 3;
    const BINARY: u8 = 4;
    const UTF8: u8 = 5;
    const BOOL: u8 = 6;
    let integer = |bits, signed| (INT, vec![Slot::Int(bits), Slot::Byte(signed)]);
    match element {
        Element::F64 => (FLOAT, vec![Slot::Short(2)]),
        Element::F32 => (FLOAT, vec![Slot::Short(1)]),
        Element::I64 => integer(64, 1),
        Element::I32 => integer(32, 1),
        Element::U64 => integer(64, 0),
        Element::U32 => integer(32, 0),
        Element::I16 => integer(16, 1),
        Element::U16 => integer(16, 0),
        Element::I8 => integer(8, 1),
        Element::U8 => integer(8, 0),
        Element::Bool => (BOOL, Vec::new()),
        Element::Enum | Element::Text(_) => (UTF8, Vec::new()),
        Element::Bytes(_) => (BINARY, Vec::new()),
    }
}

/// The type of a column's cells, with its child types.
fn cell(column: &Column<'_>) -> (Type, Vec<Vec<Slot>>) {
    const FIXED_SIZE_BINARY: u8 = 15;
    const FIXED_SIZE_LIST: u8 = 16;
    let (element, size) = (column.field.element, Slot::Int(column.elements as i32));
    match element {
        _ if !column.is_wide() => (number(element), Vec::new()),
        _ if element.size() == 1 && element.room().is_none() => ((FIXED_SIZE_BINARY, vec![size]), Vec::new()),
        _ => {
            let inner = field("element", number(element), Vec::new(), &[]);
            ((FIXED_SIZE_LIST, vec![size]), vec![inner])
        }
    }
}

fn field(name: &str, (kind, details): Type, children: Vec<Vec<Slot>>, metadata: &[(&str, String)]) -> Vec<Slot> {
    let pairs = metadata
        .iter()
        .map(|(key, value)| vec![Slot::Text((*key).to_owned()), Slot::Text(value.clone())]);
    vec![
        Slot::Text(name.to_owned()),
        Slot::Byte(0),
        Slot::Byte(kind),
        Slot::Table(details),
        Slot::Absent,
        Slot::Tables(children),
        Slot::Tables(pairs.collect()),
    ]
}

fn align(buffer: &mut Vec<u8>, to: usize) {
    while !buffer.len().is_multiple_of(to) {
        buffer.push(0);
    }
}

/// Writes at `at` the distance from `at` to the end of the buffer: flatbuffer offsets point forward.
fn point_here(buffer: &mut [u8], at: usize) {
    let distance = (buffer.len() - at) as u32;
    buffer[at..at + 4].copy_from_slice(&distance.to_le_bytes());
}

/// Appends a table; returns its position. The values it refers to follow it.
fn table(buffer: &mut Vec<u8>, slots: &[Slot]) -> u32 {
    align(buffer, 4);
    // The vtable precedes the table; every value gets four bytes, which aligns them all.
    let list = buffer.len();
    let list_bytes = 4 + 2 * slots.len();
    buffer.resize(list + list_bytes, 0);
    align(buffer, 4);
    let start = buffer.len();
    buffer.extend(((start - list) as i32).to_le_bytes());
    let mut parts = Vec::new();
    for (at, slot) in slots.iter().enumerate() {
        let here = buffer.len();
        let value = match slot {
            Slot::Absent => continue,
            Slot::Byte(x) => i32::from(*x),
            Slot::Short(x) => i32::from(*x),
            Slot::Int(x) => *x,
            Slot::Text(_) | Slot::Table(_) | Slot::Tables(_) => {
                parts.push((here, slot));
                0
            }
        };
        buffer.extend(value.to_le_bytes());
        buffer[list + 4 + 2 * at..][..2].copy_from_slice(&((here - start) as u16).to_le_bytes());
    }
    let table_bytes = (buffer.len() - start) as u16;
    buffer[list..list + 2].copy_from_slice(&(list_bytes as u16).to_le_bytes());
    buffer[list + 2..list + 4].copy_from_slice(&table_bytes.to_le_bytes());
    for (at, slot) in parts {
        part(buffer, at, slot);
    }
    start as u32
}

fn part(buffer: &mut Vec<u8>, at: usize, slot: &Slot) {
    match slot {
        Slot::Text(text) => {
            align(buffer, 4);
            point_here(buffer, at);
            buffer.extend((text.len() as u32).to_le_bytes());
            buffer.extend(text.as_bytes());
            buffer.push(0);
        }
        Slot::Table(slots) => {
            let position = table(buffer, slots);
            let distance = position - at as u32;
            buffer[at..at + 4].copy_from_slice(&distance.to_le_bytes());
        }
        Slot::Tables(tables) => {
            align(buffer, 4);
            point_here(buffer, at);
            buffer.extend((tables.len() as u32).to_le_bytes());
            let list = buffer.len();
            buffer.resize(list + 4 * tables.len(), 0);
            for (k, slots) in tables.iter().enumerate() {
                let entry = list + 4 * k;
                let distance = table(buffer, slots) - entry as u32;
                buffer[entry..entry + 4].copy_from_slice(&distance.to_le_bytes());
            }
        }
        Slot::Absent | Slot::Byte(_) | Slot::Short(_) | Slot::Int(_) => {}
    }
}
