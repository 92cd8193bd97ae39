//! NumPy's file format for one array, used for fields that are too wide for a text table.

use lockstep::port::{Element, Field};

/// The header of a file with `samples` values of `field`, contiguous as in the payload: format version 1.0 of NumPy's
/// specification. The array's shape is the number of samples followed by the field's shape.
pub(super) fn head(field: &Field, samples: u64) -> Vec<u8> {
    let room;
    let kind = match field.element {
        Element::Text(length) => {
            room = format!("'|S{length}'");
            &room
        }
        Element::Bytes(length) => {
            room = format!("[('length', '<u4'), ('data', '|u1', ({length},))]");
            &room
        }
        Element::F64 => "'<f8'",
        Element::F32 => "'<f4'",
        Element::I64 => "'<i8'",
        Element::I32 => "'<i4'",
        Element::U64 => "'<u8'",
        Element::U32 => "'<u4'",
        Element::I16 => "'<i2'",
        Element::U16 => "'<u2'",
        Element::I8 => "'|i1'",
        Element::U8 | Element::Enum => "'|u1'",
        Element::Bool => "'|b1'",
    };
    let extents: Vec<String> = field.shape.iter().map(u32::to_string).collect();
    let shape = format!("({samples}, {})", extents.join(", "));
    let mut text = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}");
    // Padded with spaces to a multiple of 64 bytes, ending with a newline.
    let before = b"\x93NUMPY\x01\x00".len() + 2;
    while !(before + text.len() + 1).is_multiple_of(64) {
        text.push(' ');
    }
    text.push('\n');
    let mut head = b"\x93NUMPY\x01\x00".to_vec();
    head.extend((text.len() as u16).to_le_bytes());
    head.extend(text.as_bytes());
    head
}
