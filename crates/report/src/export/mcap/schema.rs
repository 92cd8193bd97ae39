//! Protobuf messages from descriptors, with the `FileDescriptorSet` that describes them to a reader.

use std::collections::HashMap;

use lockstep::port::{Descriptor, Element};

use super::proto;
use crate::export::columns::{Number, number};
use tape::StreamSpec;

/// `FieldDescriptorProto.Type`.
#[derive(Clone, Copy)]
enum Type {
    Double = 1,
    Float = 2,
    Int64 = 3,
    Uint64 = 4,
    Int32 = 5,
    Bool = 8,
    Text = 9,
    Message = 11,
    Uint32 = 13,
    Enum = 14,
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
fn file(set: &mut Vec<u8>, name: &str, package: &str, imports: &[&str], messages: &[Vec<u8>]) {
    proto::message(set, 1, |file| {
        proto::text(file, 1, name);
        proto::text(file, 2, package);
        for import in imports {
            proto::text(file, 3, import);
        }
        for message in messages {
            proto::bytes(file, 4, message);
        }
        proto::text(file, 12, "proto3");
    });
}

/// Gives every distinct descriptor a message name of its own.
#[derive(Default)]
pub(super) struct Names {
    taken: HashMap<String, Descriptor>,
}

/// A message type that mirrors a descriptor: one field each, lists where it has a shape (row-major).
pub(super) struct Schema {
    pub(super) name: String,
    pub(super) file_descriptor_set: Vec<u8>,
    descriptor: Descriptor,
}

/// Letters, digits and underscores only, as protobuf wants its names.
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

impl Names {
    pub(super) fn schema(&mut self, descriptor: &Descriptor) -> Schema {
        let plain = identifier(&descriptor.name);
        let mut name = plain.clone();
        let mut n = 1;
        while self.taken.get(&name).is_some_and(|other| other != descriptor) {
            n += 1;
            name = format!("{plain}_{n}");
        }
        self.taken.insert(name.clone(), descriptor.clone());
        let mut names: Vec<String> = Vec::new();
        for field in &descriptor.fields {
            let plain = identifier(&field.name);
            let mut name = plain.clone();
            // Two names may become one when foreign characters are replaced.
            while names.contains(&name) {
                name.push('_');
            }
            names.push(name);
        }
        let fields: Vec<FieldSpec<'_>> = descriptor
            .fields
            .iter()
            .zip(&names)
            .enumerate()
            .map(|(at, (field, name))| {
                let kind = match field.element {
                    Element::F64 => Type::Double,
                    Element::F32 => Type::Float,
                    Element::I64 => Type::Int64,
                    Element::I32 => Type::Int32,
                    Element::U64 => Type::Uint64,
                    Element::U32 | Element::U8 => Type::Uint32,
                };
                (&**name, at as u32 + 1, !field.shape.is_empty(), kind, "")
            })
            .collect();
        let mut set = Vec::new();
        let path = format!("escapement/{name}.proto");
        file(&mut set, &path, "escapement", &[], &[message_type(&name, &fields, &[])]);
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
        for (at, field) in self.descriptor.fields.iter().enumerate() {
            let (key, size, count) = (at as u32 + 1, field.element.size(), field.len());
            let fixed = matches!(field.element, Element::F64 | Element::F32);
            if fixed && !field.shape.is_empty() {
                // A packed list of fixed-size numbers has the payload's own bytes.
                proto::bytes(out, key, &payload[field.range()]);
                continue;
            }
            let mut values = Vec::new();
            let target = if field.shape.is_empty() { &mut *out } else { &mut values };
            for element in 0..count {
                let value = number(field.element, payload, field.offset as usize + element * size);
                if field.shape.is_empty() {
                    let wire = match field.element {
                        Element::F64 => 1,
                        Element::F32 => 5,
                        _ => 0,
                    };
                    proto::varint(target, u64::from(key) << 3 | wire);
                }
                match value {
                    Number::F64(x) => target.extend(x.to_le_bytes()),
                    Number::F32(x) => target.extend(x.to_le_bytes()),
                    Number::I64(x) => proto::varint(target, x as u64),
                    Number::U64(x) => proto::varint(target, x),
                }
            }
            if !field.shape.is_empty() {
                proto::bytes(out, key, &values);
            }
        }
    }
}

/// Unit, frame and shape of every field, which protobuf has no place for.
pub(super) fn channel_metadata(spec: &StreamSpec) -> Vec<(String, String)> {
    let mut pairs = vec![
        ("offset".to_owned(), spec.offset.to_string()),
        ("period".to_owned(), spec.period.to_string()),
    ];
    for field in &spec.descriptor.fields {
        pairs.push((format!("unit.{}", field.name), field.unit.clone()));
        if !field.frame.is_empty() {
            pairs.push((format!("frame.{}", field.name), field.frame.clone()));
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
        file(set, path, "google.protobuf", &[], &[message_type(name, &fields, &[])]);
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
    file(&mut set, "foxglove/SceneUpdate.proto", "foxglove", IMPORTS, &messages);
    set
}
