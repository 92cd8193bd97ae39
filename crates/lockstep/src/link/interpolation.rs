//! Linear interpolation between two samples.

use crate::port::{Descriptor, Element};

/// Interpolates linearly between two payloads of `descriptor` into `out`, at the fraction `weight` of the interval from `before` to
/// `after`. Integers and bytes are those of `before`.
pub(crate) fn interpolate(descriptor: &Descriptor, before: &[u8], after: &[u8], weight: f64, out: &mut [u8]) {
    out.copy_from_slice(before);
    for field in descriptor.fields.iter().filter(|field| field.element.is_float()) {
        for at in field.range().step_by(field.element.size()) {
            interpolate_element(
                field.element,
                &before[at..],
                &after[at..],
                weight,
                &mut out[at..at + field.element.size()],
            );
        }
    }
}

fn interpolate_element(element: Element, before: &[u8], after: &[u8], weight: f64, out: &mut [u8]) {
    let (a, b) = (element.to_f64(before), element.to_f64(after));
    let difference = b - a;
    // Where the difference overflows a double, the two products do not.
    let value = if difference.is_finite() {
        a + weight * difference
    } else {
        a * (1.0 - weight) + b * weight
    };
    element.put(value, out);
}
