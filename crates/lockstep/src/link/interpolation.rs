//! Linear interpolation between two samples.

use crate::port::{Descriptor, Element};

/// Interpolates linearly between two payloads of `descriptor` into `out`, at the fraction `weight` of the interval from `before` to
/// `after`. Integers and bytes are those of `before`.
pub(crate) fn interpolate(descriptor: &Descriptor, before: &[u8], after: &[u8], weight: f64, out: &mut [u8]) {
    out.copy_from_slice(before);
    for field in descriptor.fields.iter().filter(|field| field.element.is_decimal()) {
        for at in field.range().step_by(field.element.size()) {
            put_between(
                field.element,
                &before[at..],
                &after[at..],
                weight,
                &mut out[at..at + field.element.size()],
            );
        }
    }
}

fn put_between(element: Element, before: &[u8], after: &[u8], weight: f64, out: &mut [u8]) {
    let (a, b) = (element.to_f64(before), element.to_f64(after));
    let way = b - a;
    // Where the difference overflows a double, the two products do not.
    let value = if way.is_finite() {
        a + weight * way
    } else {
        a * (1.0 - weight) + b * weight
    };
    element.put(value, out);
}
