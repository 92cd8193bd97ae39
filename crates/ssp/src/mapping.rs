//! Parameter mappings (`.ssm`): from parameters of a set to parameters of a system.

use roxmltree::Node;

use crate::error::Problem;
use crate::transform::Transformation;
use crate::xml::{Xml, children};

/// A parameter of a set under another name.
#[derive(Debug, Clone)]
pub struct MapEntry {
    /// Its name in the set.
    pub source: String,
    /// Its name in the system.
    pub target: String,
    /// Whether unit conversion is suppressed.
    pub suppress: bool,
    /// The transformation of the value.
    pub transformation: Transformation,
}

/// Reads a `ParameterMapping`, the root of a file or an element of a description.
///
/// # Errors
/// What is missing or wrong, with its line.
pub fn read(xml: Xml<'_>, root: Node<'_, '_>) -> Result<Vec<MapEntry>, Problem> {
    xml.root(root, "ParameterMapping")?;
    let mut all: Vec<MapEntry> = Vec::new();
    for node in children(root, "MappingEntry") {
        let entry = MapEntry {
            source: xml.required_attribute(node, "source")?,
            target: xml.required_attribute(node, "target")?,
            suppress: xml.flag(node, "suppressUnitConversion")?,
            transformation: Transformation::read(xml, node)?,
        };
        if all.iter().any(|one| one.target == entry.target) {
            return Err(xml.problem(node, format!("two parameters are mapped to `{}`", entry.target)));
        }
        all.push(entry);
    }
    Ok(all)
}
