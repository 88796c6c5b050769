//! The face and the take that the demo animates.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::TemplateError;
use super::geometry::{Steps, to_vector, unpack};
use crate::mesh::{FaceGroup, Mesh, Polygons};
use crate::{Point, Vector};

/// A face as it is kept: parts in millimetres about the middle between the eyes, and where the
/// whole goes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredFace {
    /// Name, positions and triangles of each part.
    pub(super) groups: Vec<(String, Vec<Steps>, Vec<[u32; 3]>)>,
    /// Columns of the rotation.
    pub(super) rotation: [[f64; 3]; 3],
    /// Length of one unit of the face. (mm)
    pub(super) millimetres_per_unit: f64,
    /// Where the middle between the eyes goes, in the face's unit.
    pub(super) place: [f64; 3],
}

/// One mesh out of all parts, in the face's own unit and place.
pub(super) fn assemble(face: &StoredFace) -> Result<Mesh, TemplateError> {
    let rotation = nalgebra::Matrix3::from(face.rotation);
    let mut positions: Vec<Point> = Vec::new();
    let mut polygons = Polygons::new();
    let mut groups = Vec::new();
    for (name, steps, triangles) in &face.groups {
        let first = positions.len() as u32;
        let start = polygons.len();
        positions.extend(steps.iter().map(|s| {
            let turned = rotation * to_vector(s) / face.millimetres_per_unit;
            Point::from(turned + Vector::from(face.place))
        }));
        for triangle in triangles {
            polygons.push(&triangle.map(|v| v.saturating_add(first)));
        }
        groups.push(FaceGroup {
            name: name.clone(),
            faces: start..polygons.len(),
        });
    }
    Mesh::new(positions, polygons)
        .map(|mesh| mesh.with_groups(groups))
        .map_err(|source| TemplateError::Mesh {
            part: "face".to_owned(),
            source,
        })
}

static DEMO_FACE: LazyLock<Mesh> = LazyLock::new(|| {
    let bytes = include_bytes!("../../../../templates/demo/face.bin");
    match unpack(bytes).and_then(|face| assemble(&face)) {
        Ok(mesh) => mesh,
        // Part of the binary and loaded by a test, like the template itself.
        Err(error) => panic!("the embedded demo face is damaged: {error}"),
    }
});

/// A face that is not the template: another person, remeshed, in metres, turned and shifted,
/// with loose eyeballs, teeth and tongue as groups.
pub fn demo_face() -> Mesh {
    DEMO_FACE.clone()
}

/// The demo's performance as keyed weights: brows, blinks, smiles, sneer, jaw, pucker, funnel,
/// speech, and a shake of the head.
pub fn demo_take() -> &'static str {
    include_str!("../../../../templates/demo/take.keys")
}

/// A take for contact: lips that press and open, a face that is pressed, blinks over eyes that
/// look about.
pub fn demo_contact_take() -> &'static str {
    include_str!("../../../../templates/demo/contact.keys")
}

/// A take for what skin and fat do by themselves: brows that fold the forehead, eyes that fold
/// their corners, a head that lies down, a gust, a shake.
pub fn demo_physics_take() -> &'static str {
    include_str!("../../../../templates/demo/physics.keys")
}

/// Colliders of the take for contact as text: a finger on the demo face's cheek, a ball on its forehead.
pub fn demo_contact_colliders() -> &'static str {
    include_str!("../../../../templates/demo/contact.toml")
}
