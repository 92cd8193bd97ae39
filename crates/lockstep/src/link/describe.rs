//! Text descriptions of conversions, for printing a plan.

use super::{Conversion, Pair, Term};
use crate::fault::Slot;
use crate::port::{Descriptor, Field};

impl Conversion {
    /// One line for each field, or part of one, of the input that takes `takes`: `u [rad] = 0.017453292519943295 * x [deg]`.
    pub fn describe(&self, takes: &Descriptor) -> Vec<String> {
        self.pairs.iter().map(|pair| self.describe_pair(pair, takes)).collect()
    }

    /// The names of the fields and elements that it feeds.
    pub fn targets(&self, takes: &Descriptor) -> Vec<String> {
        let name = |pair: &Pair| elements_name(takes, pair.to, pair.count).map_or_else(String::new, |(name, _)| name);
        self.pairs.iter().map(name).collect()
    }

    fn describe_pair(&self, pair: &Pair, takes: &Descriptor) -> String {
        let Some((to, field)) = elements_name(takes, pair.to, pair.count) else {
            return String::new();
        };
        let mut parts: Vec<String> = pair
            .terms
            .iter()
            .map(|term| self.describe_term(term, pair, field))
            .collect();
        if pair.offset != 0.0 || parts.is_empty() {
            parts.push(format!("{}", pair.offset));
        }
        let sign = if pair.adds { "+=" } else { "=" };
        format!("{to}{} {sign} {}", unit_text(field), parts.join(" + "))
    }

    fn describe_term(&self, term: &Term, pair: &Pair, to: &Field) -> String {
        let Some((name, field)) = elements_name(&self.message, term.from, pair.count) else {
            return String::new();
        };
        let scale = if term.scale == 1.0 {
            String::new()
        } else {
            format!("{} * ", term.scale)
        };
        let mut text = format!("{scale}{name}{}", unit_text(field));
        if field.element != to.element {
            text += &format!(" ({} to {})", field.element, to.element);
        }
        if field.frame != to.frame {
            let frame = |field: &Field| match field.frame.as_str() {
                "" => "no frame".to_owned(),
                frame => format!("frame {frame}"),
            };
            text += &format!(" ({} to {})", frame(field), frame(to));
        }
        text
    }
}

/// ` [m/s]`; empty for dimensionless numbers.
fn unit_text(field: &Field) -> String {
    if field.unit == "1" {
        String::new()
    } else {
        format!(" [{}]", field.unit)
    }
}

/// The name of `count` elements from `first` on, and the field that contains them.
fn elements_name(descriptor: &Descriptor, first: Slot, count: u32) -> Option<(String, &Field)> {
    let start = first.offset as usize;
    let field = descriptor.fields.iter().find(|field| field.range().contains(&start))?;
    if count as usize == field.len() {
        return Some((field.name.clone(), field));
    }
    let index = (start - field.range().start) / field.element.size();
    Some((field.element_name(index), field))
}
