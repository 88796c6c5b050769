//! Contact as messages: colliders as meshes, places that touch as arrows along their push.

use nalgebra::{Point3, Vector3};
use prost::Message;
use prost_types::Duration;

use super::SurfaceInfo;
use super::encode::{SurfaceEncoder, rounded};
use super::messages::{self as wire, timestamp};

/// Contact at one instant, borrowed from whoever computed it.
#[derive(Debug, Clone, Copy)]
pub struct ContactFrame<'a> {
    /// Vertices of every collider in the head frame. (mm)
    pub colliders: &'a [&'a [Point3<f32>]],
    /// Where things touch.
    pub arrows: &'a [ContactArrow],
}

/// A place that touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactArrow {
    /// Where. [mm, head frame]
    pub position: Point3<f32>,
    /// Unit direction of the push.
    pub normal: Vector3<f32>,
    /// Push. (N)
    pub force: f32,
    /// Whether a collider pushes; otherwise patches push each other.
    pub is_of_collider: bool,
}

/// Name of the entity of all arrows.
pub(super) const ARROWS: &str = "contacts";
/// Half the width of an arrow's foot. (mm)
const FOOT: f32 = 0.35;
/// Least and most length of an arrow, and length for a newton. (mm)
const LENGTHS: [f32; 2] = [1.0, 8.0];
const LENGTH_PER_NEWTON: f32 = 400.0;
const COLORS: [[u8; 3]; 2] = [[70, 190, 255], [255, 170, 40]];

/// Encodes what a scene with contact shows.
pub(super) struct ContactEncoder {
    colliders: SurfaceEncoder,
    /// Frame that everything stands in.
    frame: String,
}

impl ContactEncoder {
    /// - `frame`: that everything stands in
    pub(super) fn new(colliders: &[SurfaceInfo], frame: &str) -> Self {
        Self {
            colliders: SurfaceEncoder::new(colliders, frame),
            frame: frame.to_owned(),
        }
    }

    /// Colliders as a scene update.
    pub(super) fn colliders(&self, nanos: u64, frame: &ContactFrame<'_>) -> Vec<u8> {
        self.colliders.scene(nanos, frame.colliders)
    }

    /// Arrows as a scene update of one entity, which replaces the one before.
    pub(super) fn arrows(&self, nanos: u64, frame: &ContactFrame<'_>) -> Vec<u8> {
        let mut list = wire::TriangleList {
            pose: Some(super::encode::identity_pose()),
            ..wire::TriangleList::default()
        };
        for arrow in frame.arrows {
            append(arrow, &mut list);
        }
        let entity = wire::SceneEntity {
            timestamp: Some(timestamp(nanos)),
            frame_id: self.frame.clone(),
            id: ARROWS.to_owned(),
            lifetime: Some(Duration::default()),
            frame_locked: true,
            triangles: vec![list],
        };
        wire::SceneUpdate {
            entities: vec![entity],
        }
        .encode_to_vec()
    }
}

/// A pyramid of three sides on a triangular foot.
fn append(arrow: &ContactArrow, list: &mut wire::TriangleList) {
    let n = arrow.normal;
    let across = if n.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let u = n.cross(&across).normalize() * FOOT;
    let v = n.cross(&u);
    let [least, most] = LENGTHS;
    let tip = n * (arrow.force * LENGTH_PER_NEWTON).clamp(least, most);
    let first = list.points.len() as u32;
    let (half, high) = (0.5, 0.75_f32.sqrt());
    for by in [u, v * high - u * half, -v * high - u * half, tip] {
        let p = arrow.position + by;
        let [x, y, z] = [p.x, p.y, p.z].map(rounded);
        list.points.push(wire::Point3 { x, y, z });
        let [r, g, b] = COLORS[usize::from(arrow.is_of_collider)].map(|c| f64::from(c) / 255.0);
        list.colors.push(wire::Color { r, g, b, a: 1.0 });
    }
    for side in [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]] {
        list.indices.extend(side.map(|k| first + k));
    }
}
