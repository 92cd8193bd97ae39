//! Transformations of values on connections and mappings of parameters.

use roxmltree::Node;

use crate::error::Problem;
use crate::xml::{Xml, children, elements, parse_bool};

/// The transformation of a value on its path, after unit conversion.
#[derive(Debug, Clone, PartialEq)]
pub struct Transformation {
    /// target = factor · source + offset.
    pub factor: f64,
    /// See above.
    pub offset: f64,
    /// The name of the XML element, for a table.
    pub table: Option<&'static str>,
    /// The table from values to new values; values not in it stay unchanged.
    pub entries: Vec<(String, String)>,
}

impl Transformation {
    /// The identity: every value stays unchanged.
    pub const fn none() -> Transformation {
        Transformation {
            factor: 1.0,
            offset: 0.0,
            table: None,
            entries: Vec::new(),
        }
    }

    /// The transformation below `node`; the identity where there is none.
    ///
    /// # Errors
    /// A number or a table that is malformed.
    pub fn read(xml: Xml<'_>, node: Node<'_, '_>) -> Result<Transformation, Problem> {
        let mut own = Transformation::none();
        for element in elements(node) {
            let table = match element.tag_name().name() {
                "LinearTransformation" => {
                    own.factor = xml.number(element, "factor")?.unwrap_or(1.0);
                    own.offset = xml.number(element, "offset")?.unwrap_or(0.0);
                    continue;
                }
                "BooleanMappingTransformation" => "BooleanMappingTransformation",
                "IntegerMappingTransformation" => "IntegerMappingTransformation",
                "EnumerationMappingTransformation" => "EnumerationMappingTransformation",
                _ => continue,
            };
            own.table = Some(table);
            for entry in children(element, "MapEntry") {
                let source = xml.required_attribute(entry, "source")?;
                let target = xml.required_attribute(entry, "target")?;
                own.entries
                    .push((normalised_literal(&source), normalised_literal(&target)));
            }
        }
        Ok(own)
    }

    /// Whether numbers stay unchanged.
    pub fn is_linear_identity(&self) -> bool {
        self.factor == 1.0 && self.offset == 0.0
    }

    /// Whether a table changes a value.
    pub fn maps(&self) -> bool {
        self.entries.iter().any(|(source, target)| source != target)
    }

    /// The result of the table for `value`.
    pub fn mapped(&self, value: &str) -> String {
        let value = normalised_literal(value);
        let found = self.entries.iter().find(|(source, _)| *source == value);
        found.map_or(value, |(_, target)| target.clone())
    }
}

/// Normalises the spelling of truth values and whole numbers.
fn normalised_literal(text: &str) -> String {
    let text = text.trim();
    match (parse_bool(text), text.parse::<i128>()) {
        (_, Ok(number)) => number.to_string(),
        (Some(value), _) => value.to_string(),
        _ => text.to_owned(),
    }
}

/// The items of the enumerations of a file: enumeration, item, value.
pub fn items(root: Node<'_, '_>) -> Vec<(String, String, i64)> {
    let mut all = Vec::new();
    for enumeration in children(root, "Enumerations").flat_map(elements) {
        let name = enumeration.attribute("name").unwrap_or_default();
        for item in elements(enumeration) {
            if let (Some(own), Some(Ok(value))) = (item.attribute("name"), item.attribute("value").map(str::parse)) {
                all.push((name.to_owned(), own.to_owned(), value));
            }
        }
    }
    all
}
