//! One frame as messages.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::frame::{NORMAL_STEP, POSITION_STEP, SurfaceInfo, UNITS_PER_MM};
use super::messages::{self as wire, timestamp};

/// Frame of all geometry.
pub(super) const HEAD_FRAME: &str = "head";
const RIG_FRAME: &str = "rig";
const WORLD_FRAME: &str = "world";

/// A coordinate in message units, rounded.
fn rounded(mm: f32) -> f64 {
    // Adding zero turns -0 into 0, which takes no bytes.
    (f64::from(mm) * UNITS_PER_MM / POSITION_STEP).round() * POSITION_STEP + 0.0
}

/// Surfaces that share a topic, with everything that stays from frame to frame encoded once.
pub(super) struct SurfaceEncoder {
    surfaces: Vec<SurfaceInfo>,
}

impl SurfaceEncoder {
    pub(super) fn new(surfaces: &[SurfaceInfo]) -> Self {
        Self {
            surfaces: surfaces.to_vec(),
        }
    }

    /// All surfaces as one scene update; `positions` fit the surfaces. (mm)
    pub(super) fn scene(&self, nanos: u64, positions: &[&[Point3<f32>]]) -> wire::SceneUpdate {
        let mut first = 0;
        let mut entities = Vec::with_capacity(self.surfaces.len());
        for (surface, positions) in self.surfaces.iter().zip(positions) {
            entities.push(entity(surface, nanos, positions, first));
            first += positions.len() as u32;
        }
        wire::SceneUpdate { entities }
    }

    /// All vertices as one cloud: x, y, z as f32 and four bytes of colour.
    pub(super) fn cloud(&self, nanos: u64, positions: &[&[Point3<f32>]]) -> wire::PointCloud {
        let count: usize = positions.iter().map(|p| p.len()).sum();
        let mut data = Vec::with_capacity(count * 16);
        for (surface, positions) in self.surfaces.iter().zip(positions) {
            let [r, g, b, _] = surface.color;
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
            frame_id: HEAD_FRAME.to_owned(),
            pose: Some(identity_pose()),
            point_stride: 16,
            fields: fields.collect(),
            data,
        }
    }
}

/// One surface; `first` counts the vertices of the message before it.
fn entity(
    surface: &SurfaceInfo,
    nanos: u64,
    positions: &[Point3<f32>],
    first: u32,
) -> wire::SceneEntity {
    let [r, g, b, a] = surface.color.map(|c| f64::from(c) / 255.0);
    let normals = normals(positions, &surface.triangles);
    let triangles = wire::TriangleList {
        pose: Some(identity_pose()),
        points: positions
            .iter()
            .map(|p| wire::Point3 {
                x: rounded(p.x),
                y: rounded(p.y),
                z: rounded(p.z),
            })
            .collect(),
        color: Some(wire::Color { r, g, b, a }),
        colors: Vec::new(),
        indices: surface.triangles.iter().flatten().copied().collect(),
        mesh_triangles: surface
            .triangles
            .iter()
            .map(|t| wire::Triangle {
                a: t[0] + first,
                b: t[1] + first,
                c: t[2] + first,
            })
            .collect(),
        mesh_normals: normals
            .iter()
            .map(|n| {
                let [x, y, z] = [n.x, n.y, n.z].map(|c| (c / NORMAL_STEP).round() * NORMAL_STEP);
                wire::Normal {
                    x: x + 0.0,
                    y: y + 0.0,
                    z: z + 0.0,
                }
            })
            .collect(),
        mesh_colors: vec![u32::from_be_bytes(surface.color); positions.len()],
    };
    wire::SceneEntity {
        timestamp: Some(timestamp(nanos)),
        frame_id: HEAD_FRAME.to_owned(),
        id: surface.name.clone(),
        lifetime: Some(prost_types::Duration::default()),
        frame_locked: true,
        triangles: vec![triangles],
    }
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
pub(super) fn transforms(nanos: u64, head: &Isometry3<f64>) -> wire::FrameTransforms {
    // +Y up becomes +Z up, and the face looks along -Y, towards a viewer's default camera.
    let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
    let upright = Isometry3::from_parts(Default::default(), upright);
    let mut scaled = *head;
    scaled.translation.vector *= UNITS_PER_MM;
    wire::FrameTransforms {
        transforms: vec![
            transform(nanos, WORLD_FRAME, RIG_FRAME, &upright),
            transform(nanos, RIG_FRAME, HEAD_FRAME, &scaled),
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

fn identity_pose() -> wire::Pose {
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
            assert!(error_mm <= 0.00306, "{error_mm}");
        }
        assert!(rounded(-1e-6).is_sign_positive());
    }

    #[test]
    fn the_root_turns_up_and_the_face_looks_along_minus_y() {
        let frames = transforms(0, &Isometry3::identity());
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
        };
        let positions = [
            Point3::new(0.0f32, 0.0, 0.0),
            Point3::new(10.0, 0.0, 0.0),
            Point3::new(0.0, 10.0, 0.0),
        ];
        let encoder = SurfaceEncoder::new(&[surface("one"), surface("two")]);
        let scene = encoder.scene(0, &[&positions, &positions]);
        let second = &scene.entities[1].triangles[0];
        assert_eq!(second.indices, [0, 1, 2]);
        assert_eq!(second.mesh_triangles[0].a, 3);
        assert_eq!(second.mesh_normals[0].z, 1.0);
        assert_eq!(second.mesh_colors[0], 0x0a14_1eff);
    }
}
