//! Protobuf messages from descriptors, with the `FileDescriptorSet` that describes them to a reader.

use std::collections::HashMap;

use lockstep::port::{Content, Descriptor, Element, Field};

use super::proto;
use crate::export::columns::{descriptor, distinct, fields, is_wide};
use tape::StreamSpec;

/// `FieldDescriptorProto.Type`.
#[derive(Clone, Copy)]
enum Type {
    Double = 1,
    Float = 2,
    Int64 = 3,
    Int32 = 5,
    Fixed64 = 6,
    Fixed32 = 7,
    Bool = 8,
    Text = 9,
    Message = 11,
    Bytes = 12,
    Uint32 = 13,
    Enum = 14,
    Sfixed32 = 15,
    Sfixed64 = 16,
    Sint32 = 17,
}

/// A field of a schema: name, number, repeated, type, name of the type.
type FieldSpec<'a> = (&'a str, u32, bool, Type, &'a str);

fn message_type(name: &str, fields: &[FieldSpec<'_>], enums: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    proto::text(&mut out, 1, name);
    for (name, number, repeated, kind, type_name) in fields {
        proto::message(&mut out, 2, |field| {
            proto::text(field, 1, name);
            proto::integer(field, 3, u64::from(*number));
            proto::integer(field, 4, if *repeated { 3 } else { 1 });
            proto::integer(field, 5, *kind as u64);
            if !type_name.is_empty() {
                proto::text(field, 6, type_name);
            }
        });
    }
    if !enums.is_empty() {
        proto::bytes(&mut out, 4, enums);
    }
    out
}

/// A `FileDescriptorProto` as an entry of a set.
fn file(set: &mut Vec<u8>, name: &str, package: &str, imports: &[&str], messages: &[Vec<u8>], syntax: &str) {
    proto::message(set, 1, |file| {
        proto::text(file, 1, name);
        proto::text(file, 2, package);
        for import in imports {
            proto::text(file, 3, import);
        }
        for message in messages {
            proto::bytes(file, 4, message);
        }
        proto::text(file, 12, syntax);
    });
}

/// Assigns a unique message name to every distinct descriptor.
#[derive(Default)]
pub(super) struct Names {
    taken: HashMap<String, Descriptor>,
}

/// A message type that mirrors a descriptor: a field for each of its fields, lists where it has a shape (row-major), bytes
/// instead of a long list of bytes.
pub(super) struct Schema {
    pub(super) name: String,
    pub(super) file_descriptor_set: Vec<u8>,
    /// Of the exported fields alone: they need not fill the payload.
    descriptor: Descriptor,
}

/// Replaces all characters that protobuf does not allow in names.
fn identifier(text: &str) -> String {
    let mut name: String = text
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        name.insert(0, '_');
    }
    name
}

/// The names of the fields in the message. Replacing characters may make names equal: then the names that are valid
/// unchanged keep them, and the others get a number.
fn identifiers(fields: &[Field]) -> Vec<String> {
    let mut order: Vec<usize> = (0..fields.len()).collect();
    order.sort_by_key(|at| identifier(&fields[*at].name) != fields[*at].name);
    let wanted = order.iter().map(|at| identifier(&fields[*at].name)).collect();
    let numbered = |at: usize, n: usize| format!("{}_{n}", identifier(&fields[order[at]].name));
    let mut placed: Vec<(usize, String)> = order.iter().copied().zip(distinct(wanted, numbered)).collect();
    placed.sort();
    placed.into_iter().map(|(_, name)| name).collect()
}

/// The type of a field. Its bytes on the wire are those of the payload, except for elements of one or two bytes and short
/// lists of them.
fn kind(field: &Field) -> Type {
    match field.element {
        Element::F64 => Type::Double,
        Element::F32 => Type::Float,
        Element::I64 => Type::Sfixed64,
        Element::I32 => Type::Sfixed32,
        Element::U64 => Type::Fixed64,
        Element::U32 => Type::Fixed32,
        Element::U8 if is_wide(field) => Type::Bytes,
        Element::U8 | Element::U16 => Type::Uint32,
        Element::I8 | Element::I16 => Type::Sint32,
        Element::Bool => Type::Bool,
        Element::Enum => Type::Enum,
        Element::Text(_) => Type::Text,
        Element::Bytes(_) => Type::Bytes,
    }
}

/// The message type of a stream, in proto2: proto3 forbids fields whose names differ only in case and underscores, such as
/// `q_1` and `q1`, because their default JSON names would be equal, and some readers enforce this whatever JSON names are
/// given. Here every JSON name is the field's own.
///
/// The names of enumeration values share the scope of their enumeration, so each enumeration is inside a message of its
/// own.
fn stream_type(name: &str, fields: &[Field], identifiers: &[String]) -> Vec<u8> {
    const LABEL_OPTIONAL: u64 = 1;
    const LABEL_REPEATED: u64 = 3;
    let mut out = Vec::new();
    proto::text(&mut out, 1, name);
    for (at, (field, identifier)) in fields.iter().zip(identifiers).enumerate() {
        let kind = kind(field);
        let content = field.element.room().is_some();
        let repeated = !field.shape.is_empty() && (content || !matches!(kind, Type::Bytes));
        proto::message(&mut out, 2, |described| {
            proto::text(described, 1, identifier);
            proto::integer(described, 3, at as u64 + 1);
            proto::integer(described, 4, if repeated { LABEL_REPEATED } else { LABEL_OPTIONAL });
            proto::integer(described, 5, kind as u64);
            if let Type::Enum = kind {
                proto::text(described, 6, &format!(".escapement.{name}.{identifier}_.Value"));
            }
            if repeated && !content {
                let packed = |options: &mut Vec<u8>| proto::integer(options, 2, 1);
                proto::message(described, 8, packed);
            }
            proto::text(described, 10, identifier);
        });
    }
    for (field, identifier) in fields
        .iter()
        .zip(identifiers)
        .filter(|(field, _)| !field.values.is_empty())
    {
        proto::bytes(
            &mut out,
            3,
            &message_type(&format!("{identifier}_"), &[], &enumeration(field)),
        );
    }
    out
}

/// The named values of a field as an enumeration called `Value`.
fn enumeration(field: &Field) -> Vec<u8> {
    let wanted = field.values.iter().map(|named| identifier(&named.name)).collect();
    let numbered = |at: usize, n: usize| format!("{}_{n}", identifier(&field.values[at].name));
    let mut out = Vec::new();
    proto::text(&mut out, 1, "Value");
    for (named, name) in field.values.iter().zip(distinct(wanted, numbered)) {
        proto::message(&mut out, 2, |value| {
            proto::text(value, 1, &name);
            proto::integer(value, 2, u64::from(named.value));
        });
    }
    out
}

/// An element of one or two bytes as a varint.
fn small(element: Element, bytes: &[u8]) -> u64 {
    let whole = element.to_integer(bytes) as i64;
    match element {
        Element::I8 | Element::I16 => ((whole << 1) ^ (whole >> 63)) as u64,
        _ => whole as u64,
    }
}

impl Names {
    pub(super) fn schema(&mut self, spec: &StreamSpec) -> Schema {
        let descriptor = &descriptor(spec);
        let plain = identifier(&descriptor.name);
        let mut name = plain.clone();
        let mut n = 1;
        while self.taken.get(&name).is_some_and(|other| other != descriptor) {
            n += 1;
            name = format!("{plain}_{n}");
        }
        self.taken.insert(name.clone(), descriptor.clone());
        let fields = &descriptor.fields;
        let message = stream_type(&name, fields, &identifiers(fields));
        let mut set = Vec::new();
        let path = format!("escapement/{name}.proto");
        file(&mut set, &path, "escapement", &[], &[message], "proto2");
        Schema {
            name: format!("escapement.{name}"),
            file_descriptor_set: set,
            descriptor: descriptor.clone(),
        }
    }
}

impl Schema {
    /// The message of a payload.
    pub(super) fn encode(&self, payload: &[u8], out: &mut Vec<u8>) {
        const VARINT: u64 = 0;
        const EIGHT_BYTES: u64 = 1;
        const FOUR_BYTES: u64 = 5;
        for (at, field) in self.descriptor.fields.iter().enumerate() {
            let (key, bytes) = (at as u32 + 1, &payload[field.range()]);
            let element = field.element;
            if element.room().is_some() {
                for bytes in bytes.chunks_exact(element.size()) {
                    let content = element.content(bytes).ok();
                    proto::bytes(out, key, content.as_ref().map_or(&[], Content::as_bytes));
                }
                continue;
            }
            let single = element.size() < 4 && !matches!(kind(field), Type::Bytes);
            if !field.shape.is_empty() {
                if single {
                    let mut values = Vec::with_capacity(2 * bytes.len());
                    for bytes in bytes.chunks_exact(element.size()) {
                        proto::varint(&mut values, small(element, bytes));
                    }
                    proto::bytes(out, key, &values);
                } else {
                    proto::bytes(out, key, bytes);
                }
                continue;
            }
            let wire = match element.size() {
                8 => EIGHT_BYTES,
                4 => FOUR_BYTES,
                _ => VARINT,
            };
            proto::varint(out, u64::from(key) << 3 | wire);
            if single {
                proto::varint(out, small(element, bytes));
            } else {
                out.extend_from_slice(bytes);
            }
        }
    }
}

/// Unit, frame and shape of every field, which protobuf cannot express, under the field's own name; and that name where the
/// message has another.
pub(super) fn channel_metadata(spec: &StreamSpec) -> Vec<(String, String)> {
    let mut pairs = vec![
        ("offset".to_owned(), spec.offset.to_string()),
        ("period".to_owned(), spec.period.to_string()),
    ];
    let fields: Vec<Field> = fields(spec).cloned().collect();
    for (field, identifier) in fields.iter().zip(identifiers(&fields)) {
        if identifier != field.name {
            pairs.push((format!("field.{identifier}"), field.name.clone()));
        }
        pairs.push((format!("unit.{}", field.name), field.unit.clone()));
        if !field.frame.is_empty() {
            pairs.push((format!("frame.{}", field.name), field.frame.clone()));
        }
        if !field.values.is_empty() {
            let values = field
                .values
                .iter()
                .map(|named| format!("{}={}", named.value, named.name));
            pairs.push((format!("values.{}", field.name), values.collect::<Vec<_>>().join(",")));
        }
        if field.shape.len() > 1 {
            pairs.push((format!("shape.{}", field.name), format!("{:?}", field.shape)));
        }
    }
    pairs
}

const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const VECTOR: &str = ".foxglove.Vector3";

fn time_files(set: &mut Vec<u8>) {
    for (path, name) in [
        ("google/protobuf/timestamp.proto", "Timestamp"),
        ("google/protobuf/duration.proto", "Duration"),
    ] {
        let fields = [
            ("seconds", 1, false, Type::Int64, ""),
            ("nanos", 2, false, Type::Int32, ""),
        ];
        let message = message_type(name, &fields, &[]);
        file(set, path, "google.protobuf", &[], &[message], "proto3");
    }
}

fn numbers(name: &str, parts: &[&str]) -> Vec<u8> {
    let fields: Vec<FieldSpec<'_>> = parts
        .iter()
        .enumerate()
        .map(|(at, part)| (*part, at as u32 + 1, false, Type::Double, ""))
        .collect();
    message_type(name, &fields, &[])
}

const IMPORTS: &[&str] = &["google/protobuf/timestamp.proto", "google/protobuf/duration.proto"];

/// The well-known schema of frame transforms.
pub(super) fn frame_transforms() -> Vec<u8> {
    let mut set = Vec::new();
    time_files(&mut set);
    let transform = message_type(
        "FrameTransform",
        &[
            ("timestamp", 1, false, Type::Message, TIMESTAMP),
            ("parent_frame_id", 2, false, Type::Text, ""),
            ("child_frame_id", 3, false, Type::Text, ""),
            ("translation", 4, false, Type::Message, VECTOR),
            ("rotation", 5, false, Type::Message, ".foxglove.Quaternion"),
        ],
        &[],
    );
    let all = message_type(
        "FrameTransforms",
        &[("transforms", 1, true, Type::Message, ".foxglove.FrameTransform")],
        &[],
    );
    let messages = [
        numbers("Vector3", &["x", "y", "z"]),
        numbers("Quaternion", &["x", "y", "z", "w"]),
        transform,
        all,
    ];
    file(
        &mut set,
        "foxglove/FrameTransforms.proto",
        "foxglove",
        IMPORTS,
        &messages,
        "proto3",
    );
    set
}

/// The well-known schema of scenes, with the primitives that are used.
pub(super) fn scene_update() -> Vec<u8> {
    let mut set = Vec::new();
    time_files(&mut set);
    let pose = (".foxglove.Pose", ".foxglove.Color");
    let solid = |name: &str, scales: bool| {
        let mut fields = vec![
            ("pose", 1, false, Type::Message, pose.0),
            ("size", 2, false, Type::Message, VECTOR),
        ];
        if scales {
            fields.push(("bottom_scale", 3, false, Type::Double, ""));
            fields.push(("top_scale", 4, false, Type::Double, ""));
        }
        fields.push(("color", if scales { 5 } else { 3 }, false, Type::Message, pose.1));
        message_type(name, &fields, &[])
    };
    let mut deletion_kinds = Vec::new();
    proto::text(&mut deletion_kinds, 1, "Type");
    for (number, name) in [(0, "MATCHING_ID"), (1, "ALL")] {
        proto::message(&mut deletion_kinds, 2, |value| {
            proto::text(value, 1, name);
            proto::integer(value, 2, number);
        });
    }
    let messages = [
        numbers("Vector3", &["x", "y", "z"]),
        numbers("Quaternion", &["x", "y", "z", "w"]),
        numbers("Color", &["r", "g", "b", "a"]),
        message_type(
            "Pose",
            &[
                ("position", 1, false, Type::Message, VECTOR),
                ("orientation", 2, false, Type::Message, ".foxglove.Quaternion"),
            ],
            &[],
        ),
        solid("CubePrimitive", false),
        solid("SpherePrimitive", false),
        solid("CylinderPrimitive", true),
        message_type(
            "SceneEntityDeletion",
            &[
                ("timestamp", 1, false, Type::Message, TIMESTAMP),
                ("type", 2, false, Type::Enum, ".foxglove.SceneEntityDeletion.Type"),
                ("id", 3, false, Type::Text, ""),
            ],
            &deletion_kinds,
        ),
        message_type(
            "SceneEntity",
            &[
                ("timestamp", 1, false, Type::Message, TIMESTAMP),
                ("frame_id", 2, false, Type::Text, ""),
                ("id", 3, false, Type::Text, ""),
                ("lifetime", 4, false, Type::Message, ".google.protobuf.Duration"),
                ("frame_locked", 5, false, Type::Bool, ""),
                ("cubes", 8, true, Type::Message, ".foxglove.CubePrimitive"),
                ("spheres", 9, true, Type::Message, ".foxglove.SpherePrimitive"),
                ("cylinders", 10, true, Type::Message, ".foxglove.CylinderPrimitive"),
            ],
            &[],
        ),
        message_type(
            "SceneUpdate",
            &[
                ("deletions", 1, true, Type::Message, ".foxglove.SceneEntityDeletion"),
                ("entities", 2, true, Type::Message, ".foxglove.SceneEntity"),
            ],
            &[],
        ),
    ];
    let path = "foxglove/SceneUpdate.proto";
    file(&mut set, path, "foxglove", IMPORTS, &messages, "proto3");
    set
}
