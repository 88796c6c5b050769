//! Descriptors of the recorded messages, built in code.
//!
//! An MCAP file describes its own messages: each schema record holds a `FileDescriptorSet`.
//! All Foxglove messages share one set, so a reader that pools the schemas of a file never
//! meets two definitions of one name.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet,
};

use super::frame::field_name;

/// Name, number, whether it repeats, type, and the type's full name for messages and enums.
type Field<'a> = (&'a str, i32, bool, Type, &'a str);

const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const DURATION: &str = ".google.protobuf.Duration";

/// The set that describes every Foxglove message of a recording.
pub(super) fn foxglove_descriptors() -> Vec<u8> {
    let timestamp = well_known("Timestamp", "timestamp");
    let duration = well_known("Duration", "duration");
    let file = FileDescriptorProto {
        name: Some("foxglove/fabrig.proto".to_owned()),
        package: Some("foxglove".to_owned()),
        syntax: Some("proto3".to_owned()),
        dependency: vec![
            "google/protobuf/timestamp.proto".to_owned(),
            "google/protobuf/duration.proto".to_owned(),
        ],
        message_type: foxglove_messages(),
        ..Default::default()
    };
    FileDescriptorSet {
        file: vec![timestamp, duration, file],
    }
    .encode_to_vec()
}

/// The set of a message of ours with one double per name, numbered from 1.
pub(super) fn series_descriptors(message_name: &str, names: &[String]) -> Vec<u8> {
    let fields: Vec<String> = names.iter().map(|name| field_name(name)).collect();
    let fields: Vec<Field<'_>> = fields
        .iter()
        .enumerate()
        .map(|(i, name)| (name.as_str(), i as i32 + 1, false, Type::Double, ""))
        .collect();
    FileDescriptorSet {
        file: vec![FileDescriptorProto {
            name: Some(format!("fabrig/{message_name}.proto")),
            package: Some("fabrig".to_owned()),
            syntax: Some("proto3".to_owned()),
            message_type: vec![message(message_name, &fields)],
            ..Default::default()
        }],
    }
    .encode_to_vec()
}

fn foxglove_messages() -> Vec<DescriptorProto> {
    use Type::{Bool, Bytes, Double, Enum, Fixed32, Float, String as Text, Uint32};
    let m = Type::Message;
    let xyz = |number| {
        [
            ("x", 1, false, number, ""),
            ("y", 2, false, number, ""),
            ("z", 3, false, number, ""),
        ]
    };
    let doubles = xyz(Double);
    let mut packed = message(
        "PackedElementField",
        &[
            ("name", 1, false, Text, ""),
            ("offset", 2, false, Fixed32, ""),
            (
                "type",
                3,
                false,
                Enum,
                ".foxglove.PackedElementField.NumericType",
            ),
        ],
    );
    packed.enum_type.push(enumeration(
        "NumericType",
        &[
            "UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64",
        ],
    ));
    let mut log = message(
        "Log",
        &[
            ("timestamp", 1, false, m, TIMESTAMP),
            ("level", 2, false, Enum, ".foxglove.Log.Level"),
            ("message", 3, false, Text, ""),
            ("name", 4, false, Text, ""),
            ("file", 5, false, Text, ""),
            ("line", 6, false, Fixed32, ""),
        ],
    );
    log.enum_type.push(enumeration(
        "Level",
        &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"],
    ));
    vec![
        message("Vector3", &doubles),
        message("Point3", &doubles),
        message(
            "Quaternion",
            &[&doubles[..], &[("w", 4, false, Double, "")]].concat(),
        ),
        message(
            "Pose",
            &[
                ("position", 1, false, m, ".foxglove.Vector3"),
                ("orientation", 2, false, m, ".foxglove.Quaternion"),
            ],
        ),
        message(
            "Color",
            &[
                ("r", 1, false, Double, ""),
                ("g", 2, false, Double, ""),
                ("b", 3, false, Double, ""),
                ("a", 4, false, Double, ""),
            ],
        ),
        message(
            "MeshTriangle",
            &[
                ("a", 1, false, Uint32, ""),
                ("b", 2, false, Uint32, ""),
                ("c", 3, false, Uint32, ""),
            ],
        ),
        message("MeshNormal", &xyz(Float)),
        message(
            "TriangleListPrimitive",
            &[
                ("pose", 1, false, m, ".foxglove.Pose"),
                ("points", 2, true, m, ".foxglove.Point3"),
                ("color", 3, false, m, ".foxglove.Color"),
                ("colors", 4, true, m, ".foxglove.Color"),
                ("indices", 5, true, Fixed32, ""),
                ("mesh_triangles", 1000, true, m, ".foxglove.MeshTriangle"),
                ("mesh_normals", 1001, true, m, ".foxglove.MeshNormal"),
                ("mesh_colors", 1002, true, Fixed32, ""),
            ],
        ),
        message(
            "SceneEntity",
            &[
                ("timestamp", 1, false, m, TIMESTAMP),
                ("frame_id", 2, false, Text, ""),
                ("id", 3, false, Text, ""),
                ("lifetime", 4, false, m, DURATION),
                ("frame_locked", 5, false, Bool, ""),
                ("triangles", 12, true, m, ".foxglove.TriangleListPrimitive"),
            ],
        ),
        message(
            "SceneUpdate",
            &[("entities", 2, true, m, ".foxglove.SceneEntity")],
        ),
        message(
            "FrameTransform",
            &[
                ("timestamp", 1, false, m, TIMESTAMP),
                ("parent_frame_id", 2, false, Text, ""),
                ("child_frame_id", 3, false, Text, ""),
                ("translation", 4, false, m, ".foxglove.Vector3"),
                ("rotation", 5, false, m, ".foxglove.Quaternion"),
            ],
        ),
        message(
            "FrameTransforms",
            &[("transforms", 1, true, m, ".foxglove.FrameTransform")],
        ),
        packed,
        message(
            "PointCloud",
            &[
                ("timestamp", 1, false, m, TIMESTAMP),
                ("frame_id", 2, false, Text, ""),
                ("pose", 3, false, m, ".foxglove.Pose"),
                ("point_stride", 4, false, Fixed32, ""),
                ("fields", 5, true, m, ".foxglove.PackedElementField"),
                ("data", 6, false, Bytes, ""),
            ],
        ),
        log,
    ]
}

/// `google.protobuf.Timestamp` or `Duration`: seconds and nanoseconds.
fn well_known(name: &str, file: &str) -> FileDescriptorProto {
    FileDescriptorProto {
        name: Some(format!("google/protobuf/{file}.proto")),
        package: Some("google.protobuf".to_owned()),
        syntax: Some("proto3".to_owned()),
        message_type: vec![message(
            name,
            &[
                ("seconds", 1, false, Type::Int64, ""),
                ("nanos", 2, false, Type::Int32, ""),
            ],
        )],
        ..Default::default()
    }
}

fn message(name: &str, fields: &[Field<'_>]) -> DescriptorProto {
    let fields = fields
        .iter()
        .map(|&(name, number, is_repeated, kind, type_name)| {
            let label = if is_repeated {
                Label::Repeated
            } else {
                Label::Optional
            };
            FieldDescriptorProto {
                name: Some(name.to_owned()),
                number: Some(number),
                label: Some(label.into()),
                r#type: Some(kind.into()),
                type_name: (!type_name.is_empty()).then(|| type_name.to_owned()),
                ..Default::default()
            }
        });
    DescriptorProto {
        name: Some(name.to_owned()),
        field: fields.collect(),
        ..Default::default()
    }
}

fn enumeration(name: &str, values: &[&str]) -> EnumDescriptorProto {
    let values = values.iter().enumerate();
    EnumDescriptorProto {
        name: Some(name.to_owned()),
        value: values
            .map(|(number, value)| EnumValueDescriptorProto {
                name: Some((*value).to_owned()),
                number: Some(number as i32),
                ..Default::default()
            })
            .collect(),
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_that_is_named_is_described() {
        let set = FileDescriptorSet::decode(&foxglove_descriptors()[..]).expect("decodes");
        let mut known = Vec::new();
        for file in &set.file {
            for message in &file.message_type {
                known.push(format!(".{}.{}", file.package(), message.name()));
                for e in &message.enum_type {
                    known.push(format!(
                        ".{}.{}.{}",
                        file.package(),
                        message.name(),
                        e.name()
                    ));
                }
            }
        }
        for file in &set.file {
            for message in &file.message_type {
                let mut numbers: Vec<i32> = message.field.iter().map(|f| f.number()).collect();
                numbers.dedup();
                assert_eq!(numbers.len(), message.field.len());
                for field in message.field.iter().filter(|f| f.type_name.is_some()) {
                    assert!(known.iter().any(|k| k == field.type_name()), "{field:?}");
                }
            }
        }
    }
}
