//! Elements of a model description and their attributes.

use roxmltree::Node;

use super::variable::{Range, Type};

pub(super) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

pub(super) fn elements<'a>(node: Option<Node<'a, 'a>>) -> impl Iterator<Item = Node<'a, 'a>> {
    node.into_iter()
        .flat_map(|node| node.children())
        .filter(Node::is_element)
}

pub(super) fn range(node: Node<'_, '_>) -> Range {
    let text = |name| node.attribute(name).map(|text| text.trim().to_owned());
    Range {
        min: text("min"),
        // For a Binary: its maximum size, bytes.
        max: text("max").or_else(|| text("maxSize")),
    }
}

pub(super) fn text_of(node: Node<'_, '_>) -> String {
    node.attribute("description").unwrap_or_default().to_owned()
}

pub(super) fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

pub(super) fn type_of(element: &str) -> Option<Type> {
    Some(match element {
        "Real" | "Float64" => Type::Float64,
        "Float32" => Type::Float32,
        "Int8" => Type::Int8,
        "UInt8" => Type::UInt8,
        "Int16" => Type::Int16,
        "UInt16" => Type::UInt16,
        "Integer" | "Int32" => Type::Int32,
        "UInt32" => Type::UInt32,
        "Int64" => Type::Int64,
        "UInt64" => Type::UInt64,
        "Boolean" => Type::Boolean,
        "Enumeration" => Type::Enumeration,
        "String" => Type::String,
        "Binary" => Type::Binary,
        "Clock" => Type::Clock,
        _ => return None,
    })
}
