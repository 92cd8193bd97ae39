//! Messages as foreign code describes them.

use lockstep::port::{Descriptor, Element, EnumValue, Field};

use crate::table::{self, Message};

/// The element type of a number, and the extents of the field: those of texts and bytes end with their room.
fn element(number: u32, extents: &[u32]) -> Result<(Element, &[u32]), String> {
    let content = match number {
        table::TEXT => Element::Text,
        table::BYTES => Element::Bytes,
        _ => {
            let place = (number as usize).checked_sub(1);
            let element = place.and_then(|place| table::ELEMENTS.get(place));
            let element = element.ok_or_else(|| format!("there is no element type {number}"))?;
            return Ok((*element, extents));
        }
    };
    match extents.split_last() {
        Some((room, shape)) => Ok((content(*room), shape)),
        None => Err("a text or bytes need an extent, their room".into()),
    }
}

/// The descriptor for a message of foreign code.
///
/// # Safety
/// The message must be null or satisfy the ABI.
pub(crate) unsafe fn descriptor(message: *const Message) -> Result<Descriptor, String> {
    if message.is_null() {
        return Err("its message is NULL".into());
    }
    // SAFETY: it is not null, so the caller guarantees that it satisfies the ABI.
    let message = unsafe { &*message };
    // SAFETY: as above.
    let name = unsafe { table::text(message.name) }.ok_or("its message has no name (it is NULL, or not UTF-8)")?;
    if message.fields.is_null() || message.field_count > Descriptor::MAX_SIZE {
        return Err(format!("message `{name}` has no fields"));
    }
    // SAFETY: the list is as long as the message states.
    let list = unsafe { std::slice::from_raw_parts(message.fields, message.field_count as usize) };
    let mut fields = Vec::new();
    for (number, field) in list.iter().enumerate() {
        let field_error = |what: String| format!("message `{name}`, field number {}: {what}", number + 1);
        // SAFETY: as above.
        let (own, unit) = unsafe { (table::text(field.name), table::text(field.unit)) };
        let (Some(own), Some(unit)) = (own, unit) else {
            return Err(field_error("its name or unit is NULL, or not UTF-8".into()));
        };
        let shape = field.extents.get(..field.rank as usize).ok_or_else(|| {
            field_error(format!(
                "it has {} extents; at most {} are allowed",
                field.rank,
                table::RANK_MAX
            ))
        })?;
        let (element, shape) = element(field.element, shape).map_err(field_error)?;
        let (unit, values) = match element {
            Element::Enum => ("1", EnumValue::list(unit).map_err(field_error)?),
            _ => (unit, Vec::new()),
        };
        fields.push(Field {
            name: own.to_owned(),
            element,
            shape: shape.to_vec(),
            unit: unit.to_owned(),
            values,
            // SAFETY: as above.
            frame: unsafe { table::text(field.frame) }.unwrap_or_default().to_owned(),
            offset: field.offset,
        });
    }
    Ok(Descriptor {
        name: name.to_owned(),
        size: message.size,
        fields,
    })
}
