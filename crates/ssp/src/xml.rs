//! Elements and attributes of a file of the package, with line numbers for messages.

use fmu::{BASE_UNITS, BaseUnit, Unit};
use roxmltree::{Document, Node, ParsingOptions};

use crate::error::Problem;

/// The largest file, bytes.
const SIZE_MAX: usize = 64 << 20;
/// The most elements in a file.
const NODES_MAX: u32 = 4_000_000;

/// A file being read.
#[derive(Clone, Copy)]
pub struct Xml<'a> {
    /// Its name inside the package.
    pub file: &'a str,
    document: &'a Document<'a>,
}

/// Parses the bytes of `file` and passes the document to `read`.
///
/// # Errors
/// When it is not XML, or `read` rejects it.
pub fn parse<T>(
    file: &str,
    bytes: &[u8],
    read: impl for<'d> FnOnce(Xml<'d>, Node<'d, 'd>) -> Result<T, Problem>,
) -> Result<T, Problem> {
    let document = document(file, bytes)?;
    let xml = Xml {
        file,
        document: &document,
    };
    read(xml, document.root_element())
}

/// The bytes of `file` as a tree.
fn document<'a>(file: &str, bytes: &'a [u8]) -> Result<Document<'a>, Problem> {
    let problem = |line, reason| Problem {
        file: file.to_owned(),
        line,
        reason,
    };
    if bytes.len() > SIZE_MAX {
        let reason = format!("it has {} bytes; at most {SIZE_MAX} are read", bytes.len());
        return Err(problem(1, reason));
    }
    let text = std::str::from_utf8(bytes).map_err(|_| problem(1, "it is not UTF-8".into()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let options = ParsingOptions {
        nodes_limit: NODES_MAX,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options)
        .map_err(|error| problem(error.pos().row, format!("it is not XML: {error}")))
}

/// The children of `node` that are called `name`, whatever their namespace prefix.
pub fn children<'a, 'i: 'a>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    elements(node).filter(move |child| child.tag_name().name() == name)
}

/// The first child of `node` that is called `name`.
pub fn child<'a, 'i: 'a>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// All elements directly below `node`.
pub fn elements<'a, 'i: 'a>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(Node::is_element)
}

impl Xml<'_> {
    /// The line of `node`, from 1.
    pub fn line(&self, node: Node<'_, '_>) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }

    /// A problem at `node`.
    pub fn problem(&self, node: Node<'_, '_>, reason: impl Into<String>) -> Problem {
        Problem {
            file: self.file.to_owned(),
            line: self.line(node),
            reason: reason.into(),
        }
    }

    /// Rejects a root that is not called `name`.
    pub fn root(&self, node: Node<'_, '_>, name: &str) -> Result<(), Problem> {
        let own = node.tag_name().name();
        if own == name {
            return Ok(());
        }
        Err(self.problem(node, format!("the root is `{own}`, not `{name}`")))
    }

    /// A required attribute.
    pub fn required_attribute(&self, node: Node<'_, '_>, name: &str) -> Result<String, Problem> {
        let found = node.attribute(name).map(str::to_owned);
        found.ok_or_else(|| self.problem(node, format!("`{}` has no `{name}`", node.tag_name().name())))
    }

    /// A finite number, if the attribute is present.
    pub fn number(&self, node: Node<'_, '_>, name: &str) -> Result<Option<f64>, Problem> {
        let Some(text) = node.attribute(name) else {
            return Ok(None);
        };
        let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        value.map(Some).ok_or_else(|| {
            let what = node.tag_name().name();
            self.problem(
                node,
                format!("`{name}` of `{what}` is `{text}`, which is not a finite number"),
            )
        })
    }

    /// A truth value; false where the attribute is missing.
    pub fn flag(&self, node: Node<'_, '_>, name: &str) -> Result<bool, Problem> {
        match node.attribute(name).map(str::trim) {
            None => Ok(false),
            Some(text) => parse_bool(text)
                .ok_or_else(|| self.problem(node, format!("`{name}` is `{text}`, neither true nor false"))),
        }
    }

    /// The unit that the attribute `unit` of `node` names, from `Units` of the `root` of the file.
    pub fn unit(&self, root: Node<'_, '_>, node: Node<'_, '_>) -> Result<Option<Unit>, Problem> {
        let Some(name) = node.attribute("unit").filter(|name| !name.is_empty()) else {
            return Ok(None);
        };
        let name = name.to_owned();
        let mut all = children(root, "Units").flat_map(elements);
        let found = all.find(|unit| unit.attribute("name") == Some(&name));
        let Some(own) = found.and_then(|unit| child(unit, "BaseUnit")) else {
            return Ok(Some(Unit { name, base: None }));
        };
        let mut exponents = [0; 8];
        for (symbol, exponent) in BASE_UNITS.iter().zip(&mut exponents) {
            *exponent = self.number(own, symbol)?.unwrap_or(0.0) as i32;
        }
        let factor = self.number(own, "factor")?.unwrap_or(1.0);
        let offset = self.number(own, "offset")?.unwrap_or(0.0);
        if factor == 0.0 {
            return Err(self.problem(own, format!("the factor of the unit `{name}` is zero")));
        }
        let base = Some(BaseUnit {
            exponents,
            factor,
            offset,
        });
        Ok(Some(Unit { name, base }))
    }
}

/// A truth value in the notation of XML.
pub fn parse_bool(text: &str) -> Option<bool> {
    match text {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}
