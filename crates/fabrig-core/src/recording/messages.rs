//! The few Foxglove messages that a recording uses.
//!
//! Field numbers and types follow Foxglove's published schemas; `mesh_triangles`,
//! `mesh_normals` and `mesh_colors` of [`TriangleList`] are ours, numbered far above theirs.
//! Foxglove passes over them, Rerun's blueprint maps them to a shaded mesh. Descriptors of the
//! same messages are in [`super::schema`].

use prost::Message;
use prost_types::{Duration, Timestamp};

/// Field numbers of what the recorder encodes by hand.
pub(super) mod tag {
    pub(in super::super) const SCENE_ENTITIES: u32 = 2;
    pub(in super::super) const ENTITY_TIMESTAMP: u32 = 1;
    pub(in super::super) const ENTITY_TRIANGLES: u32 = 12;
    pub(in super::super) const LIST_POINTS: u32 = 2;
    pub(in super::super) const LIST_NORMALS: u32 = 1001;
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Vector3 {
    #[prost(double, tag = "1")]
    pub(super) x: f64,
    #[prost(double, tag = "2")]
    pub(super) y: f64,
    #[prost(double, tag = "3")]
    pub(super) z: f64,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Point3 {
    #[prost(double, tag = "1")]
    pub(super) x: f64,
    #[prost(double, tag = "2")]
    pub(super) y: f64,
    #[prost(double, tag = "3")]
    pub(super) z: f64,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Quaternion {
    #[prost(double, tag = "1")]
    pub(super) x: f64,
    #[prost(double, tag = "2")]
    pub(super) y: f64,
    #[prost(double, tag = "3")]
    pub(super) z: f64,
    #[prost(double, tag = "4")]
    pub(super) w: f64,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Pose {
    #[prost(message, optional, tag = "1")]
    pub(super) position: Option<Vector3>,
    #[prost(message, optional, tag = "2")]
    pub(super) orientation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Color {
    #[prost(double, tag = "1")]
    pub(super) r: f64,
    #[prost(double, tag = "2")]
    pub(super) g: f64,
    #[prost(double, tag = "3")]
    pub(super) b: f64,
    #[prost(double, tag = "4")]
    pub(super) a: f64,
}

/// Ours: one triangle, counted through all entities of a message.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Triangle {
    #[prost(uint32, tag = "1")]
    pub(super) a: u32,
    #[prost(uint32, tag = "2")]
    pub(super) b: u32,
    #[prost(uint32, tag = "3")]
    pub(super) c: u32,
}

/// Ours: a unit vector.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Normal {
    #[prost(float, tag = "1")]
    pub(super) x: f32,
    #[prost(float, tag = "2")]
    pub(super) y: f32,
    #[prost(float, tag = "3")]
    pub(super) z: f32,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct TriangleList {
    #[prost(message, optional, tag = "1")]
    pub(super) pose: Option<Pose>,
    #[prost(message, repeated, tag = "2")]
    pub(super) points: Vec<Point3>,
    #[prost(message, optional, tag = "3")]
    pub(super) color: Option<Color>,
    #[prost(message, repeated, tag = "4")]
    pub(super) colors: Vec<Color>,
    #[prost(fixed32, repeated, tag = "5")]
    pub(super) indices: Vec<u32>,
    #[prost(message, repeated, tag = "1000")]
    pub(super) mesh_triangles: Vec<Triangle>,
    #[prost(message, repeated, tag = "1001")]
    pub(super) mesh_normals: Vec<Normal>,
    /// 0xRRGGBBAA, one per point.
    #[prost(fixed32, repeated, tag = "1002")]
    pub(super) mesh_colors: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct SceneEntity {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) frame_id: String,
    #[prost(string, tag = "3")]
    pub(super) id: String,
    #[prost(message, optional, tag = "4")]
    pub(super) lifetime: Option<Duration>,
    #[prost(bool, tag = "5")]
    pub(super) frame_locked: bool,
    #[prost(message, repeated, tag = "12")]
    pub(super) triangles: Vec<TriangleList>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct SceneUpdate {
    #[prost(message, repeated, tag = "2")]
    pub(super) entities: Vec<SceneEntity>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) parent_frame_id: String,
    #[prost(string, tag = "3")]
    pub(super) child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    pub(super) translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    pub(super) rotation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    pub(super) transforms: Vec<FrameTransform>,
}

/// Numeric types of [`PackedElementField`].
pub(super) const UINT8: i32 = 1;
pub(super) const FLOAT32: i32 = 7;

#[derive(Clone, PartialEq, Message)]
pub(super) struct PackedElementField {
    #[prost(string, tag = "1")]
    pub(super) name: String,
    #[prost(fixed32, tag = "2")]
    pub(super) offset: u32,
    /// An enumeration of numeric types.
    #[prost(int32, tag = "3")]
    pub(super) r#type: i32,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct PointCloud {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) frame_id: String,
    #[prost(message, optional, tag = "3")]
    pub(super) pose: Option<Pose>,
    #[prost(fixed32, tag = "4")]
    pub(super) point_stride: u32,
    #[prost(message, repeated, tag = "5")]
    pub(super) fields: Vec<PackedElementField>,
    #[prost(bytes = "vec", tag = "6")]
    pub(super) data: Vec<u8>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Log {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    /// An enumeration: 2 info, 3 warning, 4 error.
    #[prost(int32, tag = "2")]
    pub(super) level: i32,
    #[prost(string, tag = "3")]
    pub(super) message: String,
    #[prost(string, tag = "4")]
    pub(super) name: String,
}

pub(super) fn timestamp(nanos: u64) -> Timestamp {
    Timestamp {
        seconds: (nanos / 1_000_000_000) as i64,
        nanos: (nanos % 1_000_000_000) as i32,
    }
}
