//! Parameter sets (`.ssv`): names with values.

use std::rc::Rc;

use fmu::Unit;
use roxmltree::Node;

use crate::error::Problem;
use crate::transform::items;
use crate::xml::{Xml, child, children, elements, parse_bool};

/// A value of a parameter set.
#[derive(Debug, Clone)]
pub struct ParameterValue {
    /// The parameter's name in its set.
    pub name: String,
    /// Its kind and value.
    pub content: Content,
    /// Its unit, if stated.
    pub unit: Option<Unit>,
    /// The file inside the package.
    pub file: Rc<str>,
    /// The line.
    pub line: u32,
}

/// The value of a parameter; one element unless it is an array.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// Floating-point numbers.
    Real(Vec<f64>),
    /// Whole numbers.
    Integer(Vec<i128>),
    /// Truth values.
    Boolean(Vec<bool>),
    /// Texts.
    Text(Vec<String>),
    /// Items of an enumeration by name, and their values where the set states them.
    Items(Vec<String>, Vec<(String, i64)>),
    /// Bytes in hexadecimal.
    Bytes(Vec<String>),
}

impl ParameterValue {
    /// A problem at the location of the value.
    pub fn problem(&self, reason: String) -> Problem {
        Problem {
            file: self.file.to_string(),
            line: self.line,
            reason: format!("the parameter `{}`: {reason}", self.name),
        }
    }
}

/// Reads a `ParameterSet`, the root of a file or an element of a description.
///
/// # Errors
/// What is missing or wrong, with its line.
pub fn read(xml: Xml<'_>, root: Node<'_, '_>) -> Result<Vec<ParameterValue>, Problem> {
    xml.root(root, "ParameterSet")?;
    let file: Rc<str> = xml.file.into();
    let known = items(root);
    let mut all = Vec::new();
    for node in children(root, "Parameters").flat_map(elements) {
        let name = xml.required_attribute(node, "name")?;
        let Some(own) = elements(node).find(|one| !matches!(one.tag_name().name(), "Dimension" | "Annotations")) else {
            return Err(xml.problem(
                node,
                format!("the parameter `{name}` has no value: an element such as `Real` is missing"),
            ));
        };
        let array = child(node, "Dimension").is_some();
        all.push(ParameterValue {
            content: content(xml, own, array, &known)?,
            unit: xml.unit(root, own)?,
            name,
            file: Rc::clone(&file),
            line: xml.line(node),
        });
    }
    Ok(all)
}

fn content(xml: Xml<'_>, node: Node<'_, '_>, array: bool, known: &[(String, String, i64)]) -> Result<Content, Problem> {
    let mut texts: Vec<String> = Vec::new();
    for value in children(node, "Value") {
        let text = value.attribute("value").or(value.text());
        texts.push(text.unwrap_or_default().to_owned());
    }
    let kind = node.tag_name().name();
    let words = !matches!(kind, "String" | "Enumeration" | "Binary");
    match node.attribute("value") {
        Some(value) if array && words => texts.extend(value.split_whitespace().map(str::to_owned)),
        Some(value) => texts.push(value.to_owned()),
        None if texts.is_empty() => return Err(xml.problem(node, format!("`{kind}` has no `value`"))),
        None => {}
    }
    fn parse_each<T>(texts: &[String], read: impl Fn(&str) -> Option<T>) -> Option<Vec<T>> {
        texts.iter().map(|text| read(text.trim())).collect()
    }
    let read = match kind {
        "Real" | "Float64" | "Float32" => {
            let finite = |text: &str| text.parse::<f64>().ok().filter(|value| value.is_finite());
            parse_each(&texts, finite).map(Content::Real)
        }
        "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" => {
            parse_each(&texts, |text| text.parse().ok()).map(Content::Integer)
        }
        "Boolean" => parse_each(&texts, parse_bool).map(Content::Boolean),
        "String" => Some(Content::Text(texts.clone())),
        "Binary" => Some(Content::Bytes(texts.clone())),
        "Enumeration" => {
            let wanted = node.attribute("name").unwrap_or_default();
            let own = known.iter().filter(|(name, ..)| name == wanted);
            let own = own.map(|(_, item, value)| (item.clone(), *value));
            Some(Content::Items(texts.clone(), own.collect()))
        }
        other => return Err(xml.problem(node, format!("`{other}` is no type of a parameter"))),
    };
    read.ok_or_else(|| xml.problem(node, format!("`{}` is no {kind}", texts.join(" "))))
}
