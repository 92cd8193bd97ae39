//! XML parsing with the tolerance of common URDF readers.
//!
//! Published files contain undeclared namespace prefixes, mostly inside `<gazebo>`, and document types. Both are accepted. A document
//! type is never followed: no other file is opened, and the parser rejects entities that expand without end.

use roxmltree::{Document, Error, Node, ParsingOptions};
use std::borrow::Cow;

/// Maximum number of nodes of a document: far beyond any robot, and little memory.
const NODES_MAX: u32 = 4_000_000;

/// The namespace name of an undeclared prefix is this followed by the prefix.
const UNDECLARED: &str = "undeclared:";

/// Parses `text` and hands the document to `read`. A prefix without a declaration gets one on the root element: that adds no line, so
/// lines stay those of the text.
///
/// # Errors
/// The text is not well-formed in some other way.
pub fn read_xml<T>(text: &str, read: impl FnOnce(&Document) -> T) -> Result<T, Error> {
    let mut text = Cow::Borrowed(text);
    loop {
        let options = ParsingOptions {
            allow_dtd: true,
            nodes_limit: NODES_MAX,
            ..ParsingOptions::default()
        };
        let (prefix, end) = match Document::parse_with_options(&text, options) {
            Ok(document) => return Ok(read(&document)),
            Err(Error::UnknownNamespace(prefix, at)) => match root_name_end(&text) {
                Some(end) => (prefix, end),
                None => return Err(Error::UnknownNamespace(prefix, at)),
            },
            Err(error) => return Err(error),
        };
        // each iteration declares one more prefix, and a text has no more prefixes than characters
        text = Cow::Owned(format!(
            "{} xmlns:{prefix}=\"{UNDECLARED}{prefix}\"{}",
            &text[..end],
            &text[end..]
        ));
    }
}

/// Offset of the end of the root element's name.
fn root_name_end(text: &str) -> Option<usize> {
    let mut at = 0;
    loop {
        at += text[at..].find('<')?;
        let rest = &text[at..];
        at += if rest.starts_with("<!--") {
            rest.find("-->")? + 3
        } else if rest.starts_with("<?") {
            rest.find("?>")? + 2
        } else if rest.starts_with("<!") {
            document_type_end(rest)?
        } else {
            let name = rest[1..].find(|c: char| c.is_whitespace() || matches!(c, '/' | '>'))?;
            return Some(at + 1 + name);
        };
    }
}

/// The length of `<!DOCTYPE … [ … ]>`: up to the first `>` outside brackets, quotes and comments.
fn document_type_end(text: &str) -> Option<usize> {
    let (mut depth, mut quote) = (0_u32, None);
    let mut characters = text.char_indices();
    while let Some((at, c)) = characters.next() {
        match (quote, c) {
            (Some(open), _) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '-') if text[..at].ends_with("<!-") => {
                let end = at + text[at..].find("-->")? + 2;
                characters.by_ref().find(|(next, _)| *next == end)?;
            }
            (None, '"' | '\'') => quote = Some(c),
            (None, '[') => depth += 1,
            (None, ']') => depth = depth.saturating_sub(1),
            (None, '>') if depth == 0 => return Some(at + 1),
            _ => {}
        }
    }
    None
}

/// Whether an element belongs to URDF: it is in the namespace of the root, which usually has none.
pub(super) fn is_urdf_element(node: Node) -> bool {
    node.tag_name().namespace() == node.document().root_element().tag_name().namespace()
}

/// Whether an element belongs to a macro language, which must be expanded first.
pub(super) fn is_macro(node: Node) -> bool {
    node.tag_name()
        .namespace()
        .is_some_and(|name| name.rsplit(['/', ':', '#']).next() == Some("xacro"))
}

/// The name of an element as written in the file, as far as it can be determined.
pub(super) fn displayed_name(node: Node) -> String {
    let name = node.tag_name();
    let prefix = name
        .namespace()
        .and_then(|namespace| match namespace.strip_prefix(UNDECLARED) {
            Some(prefix) => Some(prefix),
            None => node.lookup_prefix(namespace),
        });
    match prefix {
        Some(prefix) if !prefix.is_empty() => format!("<{prefix}:{}>", name.name()),
        _ => format!("<{}>", name.name()),
    }
}

/// The line an element starts on, from 1.
pub(super) fn line_of(node: Node) -> u32 {
    line_at(node, node.range().start)
}

/// The line of an offset in the document of `node`, from 1.
pub(super) fn line_at(node: Node, offset: usize) -> u32 {
    node.document().text_pos_at(offset).row
}

/// The first child of that name.
pub(super) fn element<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children()
        .find(|child| child.is_element() && is_urdf_element(*child) && child.tag_name().name() == tag)
}
