//! Bodies of a face that hold skin and patches out: eyeballs, and jaws with teeth and gums.

use nalgebra::{Isometry3, Point3};

use crate::collision::StarSurface;
use crate::mesh::Surface;
use crate::rig::Rig;
use crate::template::RigidBody;
use crate::{Point, Vector};

/// Samples along an edge of the cube of an eyeball, and of a jaw: about a millimetre apart.
const EYE_SIDE: usize = 25;
const JAW_SIDE: usize = 49;
/// How steeply bone is looked for above or below the gums, how far from them, and in what steps.
/// (rad)
const MOST_ELEVATION: f64 = 1.0;
const BONE_REACH: f64 = 0.6;
const BONE_STEP: f64 = 0.06;
/// Radii of an eyeball's mesh that are believed, against its socket's.
const BELIEVED: [f64; 2] = [0.7, 1.3];

/// A body as its surface about a point within.
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// What it moves with.
    pub(super) follows: RigidBody,
    /// At rest. [mm, head frame]
    pub(super) center: Point,
    /// What holds patches out, about its centre, at rest.
    pub(super) surface: StarSurface,
    /// What holds skin out: the same, without what is only thought of a jaw.
    pub(super) visible: StarSurface,
    /// Whether the user's mesh has it; otherwise it is the template's, as a ball.
    pub(super) is_own: bool,
}

/// The bodies of a rig: left and right eyeball, then what the user's mesh has of the upper and
/// the lower jaw.
pub(super) fn bodies(rig: &Rig) -> Vec<Body> {
    let rest = rig.skin_at_rest();
    let eyes = [0, 1].map(|eye| eyeball(rig, eye, &rest));
    let jaws = [RigidBody::Skull, RigidBody::Mandible];
    let jaws = jaws.into_iter().filter_map(|body| jaw(rig, body, &rest));
    eyes.into_iter().chain(jaws).collect()
}

/// An eyeball with its cornea.
fn eyeball(rig: &Rig, eye: usize, rest: &[Point3<f32>]) -> Body {
    let socket = &rig.eyes[eye];
    let follows = [RigidBody::EyeLeft, RigidBody::EyeRight][eye];
    let own = surface_of(rig, &vertices_of(rig, follows), rest);
    let radius_of = |direction: &Vector| {
        let hit = from_outside(
            own.as_ref()?,
            &socket.center,
            direction,
            2.0 * socket.radius,
        )?;
        let [least, most] = BELIEVED.map(|b| b * socket.radius);
        (least..most).contains(&hit).then_some(hit)
    };
    let surface = StarSurface::sample(EYE_SIDE, |d| Some(radius_of(d).unwrap_or(socket.radius)));
    Body {
        follows,
        center: socket.center,
        visible: surface.clone(),
        surface,
        is_own: own.is_some(),
    }
}

/// The outside of teeth and gums, seen from the middle of their arch, with the bone that goes on
/// from the gums; none where the user's mesh has none. Where the arch is open there is no surface.
fn jaw(rig: &Rig, follows: RigidBody, rest: &[Point3<f32>]) -> Option<Body> {
    let vertices = vertices_of(rig, follows);
    let surface = surface_of(rig, &vertices, rest)?;
    let points = || vertices.iter().map(|&v| rest[v as usize].cast::<f64>());
    let first = points().next()?;
    let (low, high) = points().fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    let center = nalgebra::center(&low, &high);
    let far = (high - low).norm();
    let hit = |d: &Vector| from_outside(&surface, &center, d, far);
    let to_bone = if follows == RigidBody::Skull {
        1.0
    } else {
        -1.0
    };
    let radius_of = |d: &Vector| {
        hit(d)
            .or_else(|| beside(d, hit))
            .or_else(|| bone(d, to_bone, hit))
    };
    Some(Body {
        follows,
        center,
        surface: StarSurface::sample(JAW_SIDE, radius_of),
        visible: StarSurface::sample(JAW_SIDE, hit),
        is_own: true,
    })
}

/// Radius a sample beside a direction: without it what lies between a sample that has one and a
/// sample that has none would have none.
fn beside(d: &Vector, hit: impl Fn(&Vector) -> Option<f64>) -> Option<f64> {
    let tilt = std::f64::consts::FRAC_PI_2 / (JAW_SIDE - 1) as f64;
    let across = d.cross(&Vector::y());
    let along = across.cross(d);
    let ways = [across, -across, along, -along];
    let tilted = ways.iter().filter_map(|way| {
        let way = way.try_normalize(1e-6)?;
        hit(&(d + way * tilt).normalize())
    });
    tilted.reduce(f64::max)
}

/// Radius of the bone that goes straight on from the gums, away from the mouth.
///
/// - `to_bone`: 1 where that is up, -1 where it is down
fn bone(d: &Vector, to_bone: f64, hit: impl Fn(&Vector) -> Option<f64>) -> Option<f64> {
    let level = Vector::new(d.x, 0.0, d.z).try_normalize(1e-6)?;
    let elevation = (d.y * to_bone).asin();
    if !(0.0..MOST_ELEVATION).contains(&elevation) {
        return None;
    }
    let gums = (1..).map(|step| elevation - f64::from(step) * BONE_STEP);
    let mut gums = gums.take_while(|&e| e > elevation - BONE_REACH);
    gums.find_map(|e| {
        let radius = hit(&(level * e.cos() + Vector::y() * (to_bone * e.sin())))?;
        Some(radius * e.cos() / elevation.cos())
    })
}

impl Body {
    /// Its pose at rest. [mm, head frame]
    pub(super) fn rest(&self) -> Isometry3<f64> {
        let c = self.center;
        Isometry3::translation(c.x, c.y, c.z)
    }

    /// Distance of a point at rest, negative inside. [mm, head frame]
    pub(super) fn distance(&self, at: &Point3<f32>) -> f64 {
        self.surface.distance(&(at.cast::<f64>() - self.center))
    }
}

/// Radius of a surface in a direction, from outside inwards, so that the cornea hides the iris
/// behind it, and teeth their inner sides; none where there is no surface. (mm)
fn from_outside(surface: &Surface, center: &Point, direction: &Vector, far: f64) -> Option<f64> {
    let from = center + direction * far;
    let hit = surface.cast_ray(&from, &-direction, far)?;
    Some(far - hit.distance)
}

/// Vertices of the pieces of the user's mesh that are rigid and follow a body.
fn vertices_of(rig: &Rig, body: RigidBody) -> Vec<u32> {
    // The tongue goes with the jaw, and bends.
    let is_of_body = |part: &&crate::rig::RigPart| part.follows == body && part.shapes.is_empty();
    let parts = rig.parts.iter().filter(is_of_body);
    parts
        .flat_map(|part| part.vertices.iter().copied())
        .collect()
}

/// The surface of these pieces.
fn surface_of(rig: &Rig, vertices: &[u32], rest: &[Point3<f32>]) -> Option<Surface> {
    let mut is_of_body = vec![false; rest.len()];
    for &v in vertices {
        is_of_body[v as usize] = true;
    }
    let mut triangles = rig.face.triangles();
    triangles.retain(|t| t.iter().all(|&v| is_of_body[v as usize]));
    let positions: Vec<Point> = rest.iter().map(|p| p.cast()).collect();
    Surface::new(&positions, &triangles).ok()
}
