//! Automatic figures: one for each field of each stream.

use lockstep::port::{Element, Field};
use tape::StreamSpec;

use super::{Curve, Figure, Formula, Signal, Unit};

/// A field with more elements than this is a picture or a point cloud: a curve for each element would be useless.
const WIDEST: usize = 256;

fn is_wide(field: &Field) -> bool {
    field.len() > WIDEST
}

/// The note about fields that have no figure.
pub(crate) fn omitted_fields_note(streams: &[StreamSpec]) -> Vec<String> {
    let fields = streams
        .iter()
        .flat_map(|spec| spec.descriptor.fields.iter().map(move |field| (spec, field)));
    let words = fields.filter_map(|(spec, field)| {
        let name = format!("{}.{}", spec.name(), field.name);
        match field.element {
            Element::Text(_) => Some(format!("{name} is a text and has no figure: `export` writes it")),
            Element::Bytes(_) => Some(format!("{name} has bytes and no figure: `export` writes them")),
            _ if is_wide(field) => Some(format!(
                "{name} has {} elements and no figure: [report] can draw single elements, and `export` writes all of them",
                field.len()
            )),
            _ => None,
        }
    });
    words.collect()
}

/// One figure per field, with the components of a vector together, in the order of participants, ports and fields.
pub(crate) fn every_field(streams: &[StreamSpec]) -> Vec<Figure> {
    let fields = streams
        .iter()
        .flat_map(|spec| spec.descriptor.fields.iter().map(move |field| (spec, field)))
        // Texts and bytes cannot be drawn on an axis.
        .filter(|(_, field)| !field.is_padding() && field.element.room().is_none() && !is_wide(field));
    let figures = fields.map(|(spec, field)| {
        let signal = Signal {
            participant: Some(spec.participant.clone()),
            port: spec.port.clone(),
            names: vec![field.name.clone()],
            part: None,
        };
        // The elements of a vector of three are labelled with the axes; elements of other fields with numbers.
        let labels = match field.shape[..] {
            [] | [3] => Vec::new(),
            [4] if field.name.starts_with("quat") => ["w", "x", "y", "z"].map(String::from).into(),
            _ => (0..field.len())
                .map(|index| field.element_name(index)[field.name.len()..].to_owned())
                .collect(),
        };
        let curve = Curve {
            formula: Formula::Each(signal),
            labels,
        };
        Figure {
            id: format!("{}.{}", spec.name(), field.name),
            group: spec.name(),
            title: field.name.clone(),
            unit: Unit::Own,
            curves: vec![curve],
            against: None,
            limits: Vec::new(),
        }
    });
    figures.collect()
}
