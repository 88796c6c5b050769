//! Bodies of a face that hold skin and patches out.

use nalgebra::{Isometry3, Point3};

use crate::collision::StarSurface;
use crate::mesh::Surface;
use crate::rig::Rig;
use crate::template::RigidBody;
use crate::{Point, Vector};

/// Samples along an edge of the cube of an eyeball: about a millimetre apart.
const EYE_SIDE: usize = 25;
/// Radii of an eyeball's mesh that are believed, against its socket's.
const BELIEVED: [f64; 2] = [0.7, 1.3];

/// An eyeball with its cornea.
#[derive(Debug, Clone)]
pub(super) struct Eyeball {
    pub(super) center: Point,
    /// About its centre, looking straight ahead.
    pub(super) surface: StarSurface,
    /// Whether the user's mesh has it; otherwise it is the template's, as a ball.
    pub(super) is_own: bool,
}

/// The eyeballs of a rig, left and right.
pub(super) fn eyeballs(rig: &Rig) -> [Eyeball; 2] {
    let rest = rig.skin_at_rest();
    [0, 1].map(|eye| {
        let socket = &rig.eyes[eye];
        let own = surface_of(rig, [RigidBody::EyeLeft, RigidBody::EyeRight][eye], &rest);
        let radius_of = |direction: &Vector| {
            // From outside inwards, so that the cornea hides the iris behind it.
            let from = socket.center + direction * (2.0 * socket.radius);
            let hit = own
                .as_ref()?
                .cast_ray(&from, &-direction, 2.0 * socket.radius)?;
            let radius = 2.0 * socket.radius - hit.distance;
            let [least, most] = BELIEVED.map(|b| b * socket.radius);
            (least..most).contains(&radius).then_some(radius)
        };
        Eyeball {
            center: socket.center,
            surface: StarSurface::sample(EYE_SIDE, |d| Some(radius_of(d).unwrap_or(socket.radius))),
            is_own: own.is_some(),
        }
    })
}

impl Eyeball {
    /// Its pose at rest. [mm, head frame]
    pub(super) fn rest(&self) -> Isometry3<f64> {
        let c = self.center;
        Isometry3::translation(c.x, c.y, c.z)
    }
}

/// The surface of all pieces of the user's mesh that follow a body.
fn surface_of(rig: &Rig, body: RigidBody, rest: &[Point3<f32>]) -> Option<Surface> {
    let mut is_of_body = vec![false; rest.len()];
    for part in rig.parts.iter().filter(|part| part.follows == body) {
        for &v in &part.vertices {
            is_of_body[v as usize] = true;
        }
    }
    let mut triangles = rig.face.triangles();
    triangles.retain(|t| t.iter().all(|&v| is_of_body[v as usize]));
    let positions: Vec<Point> = rest.iter().map(|p| p.cast()).collect();
    Surface::new(&positions, &triangles).ok()
}
