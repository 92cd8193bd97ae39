//! How each element of an input is composed.

use lockstep::fault::Slot;
use lockstep::link::{Pair, Term};
use lockstep::port::{Descriptor, Element, Field};
use lockstep::units;
use toml::Value;

use super::entry::{FieldComposition, FieldMapping, SourceTerm};
use crate::scenario::faults::values;
use crate::scenario::symbols::symbols;

/// The ports at the ends of a link, and the settings of the connection for all of its fields.
pub(super) struct LinkPorts<'a> {
    pub(super) output: &'a Descriptor,
    pub(super) input: &'a Descriptor,
    pub(super) adds: bool,
    pub(super) any_frames: bool,
}

/// Adjacent elements of a field.
struct ElementRange<'a> {
    name: &'a str,
    field: &'a Field,
    first: Slot,
    count: usize,
}

impl<'a> ElementRange<'a> {
    fn find(descriptor: &'a Descriptor, name: &'a str) -> Result<ElementRange<'a>, String> {
        let Some((field, elements)) = descriptor.resolve(name) else {
            let known: Vec<String> = descriptor.fields.iter().map(|field| format!("`{field}`")).collect();
            return Err(format!(
                "`{}` has no field or element `{name}`; it has {}",
                descriptor.name,
                known.join("; ")
            ));
        };
        Ok(ElementRange {
            name,
            field,
            first: Slot::element_of(field, elements.start),
            count: elements.len(),
        })
    }

    fn is_whole(&self) -> bool {
        self.count == self.field.len()
    }
}

/// The elements that are fed when the source fields are not known: as if they were constant.
pub(super) fn targets(mapping: &FieldMapping, input: &Descriptor, adds: bool) -> Vec<Pair> {
    let names: Vec<&str> = match mapping {
        FieldMapping::Unchanged => Vec::new(),
        FieldMapping::ByName => fields_without_padding(input).map(|field| field.name.as_str()).collect(),
        FieldMapping::Named(named) => named.iter().map(|(to, _)| to.as_str()).collect(),
    };
    let ranges = names
        .into_iter()
        .filter_map(|name| ElementRange::find(input, name).ok());
    let pair = |range: ElementRange<'_>| Pair {
        to: range.first,
        count: range.count as u32,
        terms: Vec::new(),
        offset: 0.0,
        adds,
    };
    ranges.map(pair).collect()
}

/// The fields that a connection by name feeds. Padding is not fed: a field of the output with its name has another meaning.
fn fields_without_padding(input: &Descriptor) -> impl Iterator<Item = &Field> {
    input.fields.iter().filter(|field| !field.is_padding())
}

impl LinkPorts<'_> {
    /// Every field of the input from the field of the same name.
    pub(super) fn by_name(&self) -> Result<Vec<Pair>, String> {
        let each = fields_without_padding(self.input).map(|field| {
            let part = SourceTerm {
                from: field.name.clone(),
                factor: None,
            };
            let composition = FieldComposition {
                terms: vec![part],
                ..FieldComposition::default()
            };
            self.pairs(&field.name, &composition)
        });
        Ok(each.collect::<Result<Vec<Vec<Pair>>, String>>()?.concat())
    }

    /// The pairs for the field or element `to` of the input.
    pub(super) fn pairs(&self, to: &str, composition: &FieldComposition) -> Result<Vec<Pair>, String> {
        let range = ElementRange::find(self.input, to)?;
        let terms = composition.terms.iter().map(|part| self.term(&range, part));
        let terms: Vec<Term> = terms.collect::<Result<_, String>>()?;
        let offsets = match (&composition.value, &composition.offset) {
            (Some(value), _) => constants(&range, value)?,
            (None, Some(offset)) => values(offset, &range.field.unit, range.count)
                .map_err(|reason| format!("`{to}`: the offset {reason}"))?,
            (None, None) => vec![0.0],
        };
        let pair = |number: u32, count: u32, offset: f64| Pair {
            to: Slot {
                offset: range.first.offset + number * range.first.element.size() as u32,
                ..range.first
            },
            count,
            terms: terms.iter().map(|term| offset_term(term, number)).collect(),
            offset,
            adds: self.adds,
        };
        let same = offsets.iter().all(|offset| offset.to_bits() == offsets[0].to_bits());
        let pairs: Vec<Pair> = if same {
            vec![pair(0, range.count as u32, offsets[0])]
        } else {
            let each = offsets.iter().enumerate();
            each.map(|(number, &offset)| pair(number as u32, 1, offset)).collect()
        };
        let computed = pairs.iter().any(|pair| !pair.terms.is_empty() && !pair.copies());
        if (computed || self.adds) && !range.field.element.is_float() {
            return Err(format!(
                "`{}` is made of values that are taken over as they are: leave `factor`, `offset`, sums and other units out, or make it \
                 f64",
                range.field
            ));
        }
        if computed || self.adds {
            let mut parts = composition
                .terms
                .iter()
                .filter_map(|part| ElementRange::find(self.output, &part.from).ok());
            let symbol = |field: &Field| field.element == Element::Enum || field.element.room().is_some();
            if let Some(part) = parts.find(|part| symbol(part.field)) {
                return Err(format!(
                    "`{}` is no number, with which nothing can be computed: leave `factor`, `offset` and sums out",
                    part.field
                ));
            }
        }
        Ok(pairs)
    }

    fn term(&self, to: &ElementRange<'_>, part: &SourceTerm) -> Result<Term, String> {
        let from = ElementRange::find(self.output, &part.from)?;
        let shapes = from.is_whole() && to.is_whole() && from.count > 1 && from.field.shape != to.field.shape;
        if from.count != to.count || shapes {
            return Err(format!(
                "`{}` has {} of `{}` and `{}` has {} of `{}`: name elements, such as `{}`, or fields of one shape",
                from.name,
                element_count(from.count),
                from.field,
                to.name,
                element_count(to.count),
                to.field,
                if from.count > to.count { &from } else { to }.field.element_name(0)
            ));
        }
        if !to.field.element.holds(from.field.element) {
            return Err(format!(
                "`{}` cannot be `{}`: {} does not hold every value of {}; make the input {}",
                to.field, from.field, to.field.element, from.field.element, from.field.element,
            ));
        }
        if to.field.element == Element::Enum {
            let mut missing = (from.field.values.iter()).filter(|named| !to.field.values.contains(named));
            if let Some(missing) = missing.next() {
                return Err(format!(
                    "`{}` cannot be `{}`: it has no value `{}` ({}); make the input the same enumeration, or u8",
                    to.field, from.field, missing.name, missing.value
                ));
            }
        }
        let (from_frame, to_frame) = (&from.field.frame, &to.field.frame);
        if !self.any_frames && !from_frame.is_empty() && !to_frame.is_empty() && from_frame != to_frame {
            return Err(format!(
                "`{}` is not in the frame of `{}`: write frames = \"any\" in the connection if the numbers are meant all the same",
                from.field, to.field
            ));
        }
        let scale = scale(part, from.field, to.field)
            .map_err(|reason| format!("`{}` does not become `{}`: {reason}", from.field, to.field))?;
        Ok(Term {
            from: from.first,
            scale,
        })
    }
}

fn offset_term(term: &Term, number: u32) -> Term {
    let from = Slot {
        offset: term.from.offset + number * term.from.element.size() as u32,
        ..term.from
    };
    Term { from, ..*term }
}

fn element_count(count: usize) -> String {
    if count == 1 {
        "one element".to_owned()
    } else {
        format!("{count} elements")
    }
}

/// The factor by which values of `from` are multiplied.
fn scale(part: &SourceTerm, from: &Field, to: &Field) -> Result<f64, String> {
    let one = |text: &str| {
        let (values, listed) = units::convert(text, &to.unit).map_err(|error| {
            format!("{error}; a factor with a unit, such as factor = \"2 N/m\", makes one dimension of another")
        })?;
        match values[..] {
            [value] if !listed => Ok(value),
            _ => Err(format!("the factor `{text}` is a list: write one number")),
        }
    };
    let factor = match &part.factor {
        None => 1.0,
        Some(Value::Float(factor)) => *factor,
        Some(Value::Integer(factor)) => *factor as f64,
        // The unit of the product is that of the factor times that of the field.
        Some(Value::String(text)) => return one(&product(text, &from.unit)),
        Some(other) => {
            return Err(format!(
                "the factor `{other}` is not a number: write 2, 0.5 or \"2 N/m\""
            ));
        }
    };
    if !factor.is_finite() {
        return Err(format!("the factor {factor} is not finite"));
    }
    if from.unit == to.unit {
        return Ok(factor);
    }
    Ok(one(&format!("1 {}", from.unit))? * factor)
}

/// A quantity times a unit, as text.
fn product(factor: &str, unit: &str) -> String {
    if unit == "1" {
        factor.to_owned()
    } else {
        format!("{factor} {unit}")
    }
}

/// The constant values of the elements of `range`.
fn constants(range: &ElementRange<'_>, value: &Value) -> Result<Vec<f64>, String> {
    if range.field.element.room().is_some() {
        return Err(format!(
            "`{}` has no constant: let a participant give it, or say `initial`",
            range.field
        ));
    }
    if !range.field.element.is_number() {
        return symbols(value, range.field, range.count).map_err(|reason| format!("`{}`: {reason}", range.field));
    }
    // A plain number is in the unit of the field, as in a start value.
    let unit = if value.is_str() { range.field.unit.as_str() } else { "1" };
    let numbers = values(value, unit, range.count).map_err(|reason| format!("`{}`: the value {reason}", range.name))?;
    let element = range.field.element;
    for number in &numbers {
        let mut bytes = [0; 8];
        element.put(*number, &mut bytes[..element.size()]);
        let kept = element.to_f64(&bytes);
        let exact = kept.to_bits() == number.to_bits() || (*number == 0.0 && kept == 0.0);
        let large = !element.is_float() && number.abs() >= 9_007_199_254_740_992.0;
        if !number.is_finite() || large || (!exact && !element.is_float()) {
            return Err(format!(
                "`{}` cannot always be {number}: write a value that it holds",
                range.field
            ));
        }
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(fields: &[(&str, Element, &[u32], u32)], size: u32) -> Descriptor {
        let fields = fields.iter().map(|(name, element, shape, offset)| Field {
            name: (*name).into(),
            element: *element,
            shape: shape.to_vec(),
            unit: "1".into(),
            frame: String::new(),
            offset: *offset,
            values: Vec::new(),
        });
        let message = Descriptor {
            name: "Signals".into(),
            size,
            fields: fields.collect(),
        };
        assert_eq!(message.validate(), Ok(()));
        message
    }

    #[test]
    fn connection_by_name_leaves_padding_unfed() {
        let input = message(
            &[
                ("x", Element::F64, &[], 0),
                ("n", Element::U8, &[], 8),
                ("padding", Element::U8, &[7], 9),
            ],
            16,
        );
        let outputs = [
            // A value with a meaning, and padding of another length.
            message(
                &[
                    ("x", Element::F64, &[], 0),
                    ("padding", Element::F64, &[], 8),
                    ("n", Element::U8, &[], 16),
                    ("padding_2", Element::U8, &[7], 17),
                ],
                24,
            ),
            message(
                &[
                    ("x", Element::F64, &[], 0),
                    ("n", Element::U8, &[4], 8),
                    ("padding", Element::U8, &[4], 12),
                ],
                16,
            ),
        ];
        for (output, fits) in outputs.iter().zip([true, false]) {
            let ports = LinkPorts {
                output,
                input: &input,
                adds: false,
                any_frames: false,
            };
            match ports.by_name() {
                Ok(pairs) => {
                    assert!(fits);
                    let fed: Vec<u32> = pairs.iter().map(|pair| pair.to.offset).collect();
                    assert_eq!(fed, [0, 8]);
                }
                // It is about `n`, which has another shape, and not about padding.
                Err(reason) => assert!(!fits && reason.starts_with("`n` has"), "{reason}"),
            }
        }
        let fed = targets(&FieldMapping::ByName, &input, false);
        assert_eq!(fed.iter().map(|pair| pair.to.offset).collect::<Vec<_>>(), [0, 8]);
    }
}
