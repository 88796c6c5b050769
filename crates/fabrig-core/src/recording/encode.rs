//! One frame as messages.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use prost::Message;
use prost::encoding::{WireType, encode_key, encode_varint, encoded_len_varint, key_len};

use super::frame::{NORMAL_STEP, POSITION_STEP, SurfaceInfo, UNITS_PER_MM};
use super::messages::{self as wire, timestamp};

/// What the frames of a face are called: those of faces in one recording begin with their names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FrameNames {
    /// Of all geometry.
    pub(super) head: String,
    /// With +Y up, in which the head moves.
    pub(super) rig: String,
}

const WORLD_FRAME: &str = "world";

impl FrameNames {
    /// - `face`: its name; empty where it is alone
    pub(super) fn of(face: &str) -> Self {
        let name = |frame: &str| {
            if face.is_empty() {
                frame.to_owned()
            } else {
                format!("{face}/{frame}")
            }
        };
        Self {
            head: name("head"),
            rig: name("rig"),
        }
    }
}

/// A coordinate in message units, rounded.
pub(super) fn rounded(mm: f32) -> f64 {
    // Adding zero turns -0 into 0, which takes no bytes.
    (f64::from(mm) * UNITS_PER_MM / POSITION_STEP).round() * POSITION_STEP + 0.0
}

/// A surface with everything that stays from frame to frame encoded once.
struct EncodedSurface {
    info: SurfaceInfo,
    /// Fields of the triangle list but its points and normals.
    list: Vec<u8>,
    /// Fields of the entity but its time and its triangle list.
    entity: Vec<u8>,
}

/// Surfaces that share a topic.
pub(super) struct SurfaceEncoder {
    surfaces: Vec<EncodedSurface>,
    /// Frame that they stand in.
    frame: String,
}

impl SurfaceEncoder {
    /// - `frame`: that they stand in
    pub(super) fn new(surfaces: &[SurfaceInfo], frame: &str) -> Self {
        Self::encoded(surfaces, frame, EncodedSurface::new)
    }

    /// For [`Self::colored_scene`].
    pub(super) fn colored_later(surfaces: &[SurfaceInfo], frame: &str) -> Self {
        Self::encoded(surfaces, frame, EncodedSurface::colored_later)
    }

    fn encoded(
        surfaces: &[SurfaceInfo],
        frame: &str,
        encode: fn(&SurfaceInfo, u32, &str) -> EncodedSurface,
    ) -> Self {
        let mut first = 0;
        let surfaces = surfaces.iter().map(|surface| {
            let encoded = encode(surface, first, frame);
            first += surface.vertex_count as u32;
            encoded
        });
        Self {
            surfaces: surfaces.collect(),
            frame: frame.to_owned(),
        }
    }

    /// Size of [`Self::scene`] and [`Self::cloud`] together. (bytes)
    pub(super) fn frame_bytes(&self) -> usize {
        let vertices: usize = self.surfaces.iter().map(|s| s.info.vertex_count).sum();
        self.scene_bytes() + vertices * CLOUD_STRIDE
    }

    /// Size of [`Self::scene`] without a few bytes of framing. (bytes)
    fn scene_bytes(&self) -> usize {
        let surfaces = self.surfaces.iter();
        surfaces
            .map(|s| s.list.len() + s.info.vertex_count * (POINT_BYTES + NORMAL_BYTES))
            .sum()
    }

    /// All surfaces as one scene update; `positions` fit the surfaces. (mm)
    pub(super) fn scene(&self, nanos: u64, positions: &[&[Point3<f32>]]) -> Vec<u8> {
        let mut scene = Vec::with_capacity(self.scene_bytes() + 256 * (1 + self.surfaces.len()));
        for (surface, positions) in self.surfaces.iter().zip(positions) {
            surface.append_to(&mut scene, nanos, positions);
        }
        scene
    }

    /// As [`Self::scene`], each vertex in a colour of its own.
    pub(super) fn colored_scene(
        &self,
        nanos: u64,
        positions: &[&[Point3<f32>]],
        colors: &[Vec<[u8; 4]>],
    ) -> Vec<u8> {
        let mut scene = Vec::new();
        let surfaces = self.surfaces.iter().zip(positions).zip(colors);
        for ((surface, positions), colors) in surfaces {
            // Messages of one type may be encoded in parts: a parser joins them.
            let colors = wire::TriangleList {
                colors: colors.iter().map(color).collect(),
                mesh_colors: colors.iter().map(|&c| u32::from_be_bytes(c)).collect(),
                ..wire::TriangleList::default()
            };
            surface.append_with(&mut scene, nanos, positions, &colors.encode_to_vec());
        }
        scene
    }

    /// All vertices as one cloud: x, y, z as f32 and four bytes of colour.
    pub(super) fn cloud(&self, nanos: u64, positions: &[&[Point3<f32>]]) -> wire::PointCloud {
        let count: usize = positions.iter().map(|p| p.len()).sum();
        let mut data = Vec::with_capacity(count * CLOUD_STRIDE);
        for (surface, positions) in self.surfaces.iter().zip(positions) {
            let [r, g, b, _] = surface.info.color;
            for p in *positions {
                for c in p.iter() {
                    data.extend_from_slice(&(rounded(*c) as f32).to_le_bytes());
                }
                data.extend_from_slice(&[r, g, b, 255]);
            }
        }
        let names = ["x", "y", "z", "red", "green", "blue", "alpha"];
        let fields = names.iter().enumerate().map(|(i, name)| {
            let i = i as u32;
            let (offset, kind) = if i < 3 {
                (4 * i, wire::FLOAT32)
            } else {
                (9 + i, wire::UINT8)
            };
            wire::PackedElementField {
                name: (*name).to_owned(),
                offset,
                r#type: kind,
            }
        });
        wire::PointCloud {
            timestamp: Some(timestamp(nanos)),
            frame_id: self.frame.clone(),
            pose: Some(identity_pose()),
            point_stride: CLOUD_STRIDE as u32,
            fields: fields.collect(),
            data,
        }
    }
}

/// One encoded point: tag, length, three doubles with their tags.
const POINT_BYTES: usize = 29;
/// One point of a cloud: three floats and four bytes of colour.
const CLOUD_STRIDE: usize = 16;
/// One encoded normal: tag of two bytes, length, three floats with their tags.
const NORMAL_BYTES: usize = 18;

impl EncodedSurface {
    /// `first` counts the vertices of the message before this surface.
    fn new(info: &SurfaceInfo, first: u32, frame: &str) -> Self {
        Self::with_colors(info, first, frame, Some(&info.vertex_colors))
    }

    /// A surface whose vertices get their colours with every frame.
    fn colored_later(info: &SurfaceInfo, first: u32, frame: &str) -> Self {
        Self::with_colors(info, first, frame, None)
    }

    fn with_colors(
        info: &SurfaceInfo,
        first: u32,
        frame: &str,
        vertex_colors: Option<&[[u8; 4]]>,
    ) -> Self {
        let colored = vertex_colors.map_or(0, |_| info.vertex_count);
        let vertex_colors = vertex_colors.unwrap_or_default();
        let list = wire::TriangleList {
            pose: Some(identity_pose()),
            points: Vec::new(),
            color: Some(color(&info.color)),
            colors: vertex_colors.iter().map(color).collect(),
            indices: info.triangles.iter().flatten().copied().collect(),
            mesh_triangles: info
                .triangles
                .iter()
                .map(|t| wire::Triangle {
                    a: t[0] + first,
                    b: t[1] + first,
                    c: t[2] + first,
                })
                .collect(),
            mesh_normals: Vec::new(),
            mesh_colors: (0..colored)
                .map(|v| vertex_colors.get(v).unwrap_or(&info.color))
                .map(|color| u32::from_be_bytes(*color))
                .collect(),
        };
        let entity = wire::SceneEntity {
            timestamp: None,
            frame_id: frame.to_owned(),
            id: info.name.clone(),
            lifetime: Some(prost_types::Duration::default()),
            frame_locked: true,
            triangles: Vec::new(),
        };
        Self {
            info: info.clone(),
            list: list.encode_to_vec(),
            entity: entity.encode_to_vec(),
        }
    }

    /// Adds the surface to a scene update. Protobuf takes fields in any order, and zeros may
    /// be written out: every frame has its bytes in the same places, which compresses better.
    fn append_to(&self, scene: &mut Vec<u8>, nanos: u64, positions: &[Point3<f32>]) {
        self.append_with(scene, nanos, positions, &[]);
    }

    /// As [`Self::append_to`], with more encoded fields of the triangle list.
    fn append_with(&self, scene: &mut Vec<u8>, nanos: u64, positions: &[Point3<f32>], more: &[u8]) {
        let points_bytes = positions.len() * (POINT_BYTES + NORMAL_BYTES);
        let list_bytes = self.list.len() + more.len() + points_bytes;
        let time = timestamp(nanos).encode_to_vec();
        let entity_bytes = field_bytes(wire::tag::ENTITY_TIMESTAMP, time.len())
            + self.entity.len()
            + field_bytes(wire::tag::ENTITY_TRIANGLES, list_bytes);
        begin_field(scene, wire::tag::SCENE_ENTITIES, entity_bytes);
        begin_field(scene, wire::tag::ENTITY_TIMESTAMP, time.len());
        scene.extend_from_slice(&time);
        scene.extend_from_slice(&self.entity);
        begin_field(scene, wire::tag::ENTITY_TRIANGLES, list_bytes);
        scene.extend_from_slice(&self.list);
        scene.extend_from_slice(more);
        for p in positions {
            let start = scene.len();
            begin_field(scene, wire::tag::LIST_POINTS, 27);
            for (axis, c) in p.iter().enumerate() {
                scene.push(DOUBLE_TAGS[axis]);
                scene.extend_from_slice(&rounded(*c).to_le_bytes());
            }
            debug_assert_eq!(scene.len() - start, POINT_BYTES);
        }
        for n in normals(positions, &self.info.triangles) {
            let start = scene.len();
            begin_field(scene, wire::tag::LIST_NORMALS, 15);
            for (axis, c) in n.iter().enumerate() {
                let rounded = (c / NORMAL_STEP).round() * NORMAL_STEP + 0.0;
                scene.push(FLOAT_TAGS[axis]);
                scene.extend_from_slice(&rounded.to_le_bytes());
            }
            debug_assert_eq!(scene.len() - start, NORMAL_BYTES);
        }
    }
}

/// Keys of the fields 1, 2 and 3 as doubles.
const DOUBLE_TAGS: [u8; 3] = [0x09, 0x11, 0x19];
/// Keys of the fields 1, 2 and 3 as floats.
const FLOAT_TAGS: [u8; 3] = [0x0d, 0x15, 0x1d];

/// Begins a field that holds a message of so many bytes.
fn begin_field(bytes: &mut Vec<u8>, tag: u32, length: usize) {
    encode_key(tag, WireType::LengthDelimited, bytes);
    encode_varint(length as u64, bytes);
}

/// Size of a field that holds a message of so many bytes.
fn field_bytes(tag: u32, length: usize) -> usize {
    key_len(tag) + encoded_len_varint(length as u64) + length
}

/// Area-weighted unit normals; zero where no triangle gives one.
fn normals(positions: &[Point3<f32>], triangles: &[[u32; 3]]) -> Vec<Vector3<f32>> {
    let mut normals = vec![Vector3::zeros(); positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let n = (b - a).cross(&(c - a));
        for &v in t {
            normals[v as usize] += n;
        }
    }
    for n in &mut normals {
        *n = n.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    }
    normals
}

/// World to rig to head.
pub(super) fn transforms(
    nanos: u64,
    names: &FrameNames,
    head: &Isometry3<f64>,
) -> wire::FrameTransforms {
    // +Y up becomes +Z up, and the face looks along -Y, towards a viewer's default camera.
    let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let upright = Isometry3::from_parts(Default::default(), upright);
    let mut scaled = *head;
    scaled.translation.vector *= UNITS_PER_MM;
    wire::FrameTransforms {
        transforms: vec![
            transform(nanos, WORLD_FRAME, &names.rig, &upright),
            transform(nanos, &names.rig, &names.head, &scaled),
        ],
    }
}

fn transform(nanos: u64, parent: &str, child: &str, pose: &Isometry3<f64>) -> wire::FrameTransform {
    let t = pose.translation.vector;
    let q = pose.rotation;
    wire::FrameTransform {
        timestamp: Some(timestamp(nanos)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(wire::Vector3 {
            x: t.x,
            y: t.y,
            z: t.z,
        }),
        rotation: Some(wire::Quaternion {
            x: q.i,
            y: q.j,
            z: q.k,
            w: q.w,
        }),
    }
}

fn color(srgb: &[u8; 4]) -> wire::Color {
    let [r, g, b, a] = srgb.map(|c| f64::from(c) / 255.0);
    wire::Color { r, g, b, a }
}

pub(super) fn identity_pose() -> wire::Pose {
    wire::Pose {
        position: Some(wire::Vector3::default()),
        orientation: Some(wire::Quaternion {
            w: 1.0,
            ..Default::default()
        }),
    }
}

/// One double per value, as [`super::schema::series_descriptors`] numbers them.
pub(super) fn series(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (i, value) in values.into_iter().enumerate() {
        prost::encoding::double::encode(i as u32 + 1, &value, &mut bytes);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_stays_within_half_a_step_and_has_no_negative_zero() {
        for k in 0..2000 {
            let mm = (k as f32 - 1000.0) * 0.137;
            let error_mm = (rounded(mm) - f64::from(mm) * UNITS_PER_MM).abs() / UNITS_PER_MM;
            assert!(error_mm <= 0.00611, "{error_mm}");
        }
        assert!(rounded(-1e-6).is_sign_positive());
    }

    #[test]
    fn the_root_turns_up_and_the_face_looks_along_minus_y() {
        let frames = transforms(0, &FrameNames::of(""), &Isometry3::identity());
        let q = frames.transforms[0].rotation.clone().expect("rotation");
        let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
        assert!((q * Vector3::y() - Vector3::z()).norm() < 1e-12);
        assert!((q * Vector3::z() + Vector3::y()).norm() < 1e-12);
        assert!((q * Vector3::x() - Vector3::x()).norm() < 1e-12);
    }

    #[test]
    fn triangles_of_later_surfaces_count_on_and_indices_do_not() {
        let surface = |name: &str| SurfaceInfo {
            name: name.to_owned(),
            color: [10, 20, 30, 255],
            vertex_count: 3,
            triangles: vec![[0, 1, 2]],
            vertex_colors: Vec::new(),
        };
        let positions = [
            Point3::new(0.0f32, 0.0, 0.0),
            Point3::new(10.0, 0.0, 0.0),
            Point3::new(0.0, 10.0, 0.0),
        ];
        let encoder = SurfaceEncoder::new(&[surface("one"), surface("two")], "head");
        let scene = encoder.scene(1_500_000_000, &[&positions, &positions]);
        let scene = wire::SceneUpdate::decode(&scene[..]).expect("sound");
        let entity = &scene.entities[1];
        assert_eq!(
            (entity.id.as_str(), entity.frame_id.as_str()),
            ("two", "head")
        );
        assert_eq!(entity.timestamp, Some(timestamp(1_500_000_000)));
        assert_eq!(
            entity.triangles[0].points[1].x,
            0.1f64.mul_add(8192.0, 0.0).round() / 8192.0
        );
        let second = &scene.entities[1].triangles[0];
        assert_eq!(second.indices, [0, 1, 2]);
        assert_eq!(second.mesh_triangles[0].a, 3);
        assert_eq!(second.mesh_normals[0].z, 1.0);
        assert_eq!(second.mesh_colors[0], 0x0a14_1eff);
    }
}
