//! A face that is put into poses, what its landmarks then do, and claims about that.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

use std::sync::Arc;

use fabrig_core::mesh::Surface;
use fabrig_core::scene::{Scene, Simulation};
use fabrig_core::template::{self, RigidBody};
use fabrig_core::{Point, Vector};

use super::{RiggedFace, pose};

/// A face in one pose.
pub(crate) struct Posed {
    pub(crate) face: &'static RiggedFace,
    pub(crate) rest: Vec<nalgebra::Point3<f32>>,
    pub(crate) now: Vec<nalgebra::Point3<f32>>,
    pub(crate) gazes: [Vector; 2],
}

pub(crate) struct Stage {
    pub(crate) face: &'static RiggedFace,
    pub(crate) simulation: Simulation,
}

impl Stage {
    pub(crate) fn new(face: &'static RiggedFace) -> Self {
        let rig = Arc::clone(&face.rig);
        Self {
            face,
            simulation: Simulation::new(rig, Scene::without_dynamics(), None).unwrap(),
        }
    }

    /// With these shapes at weight 1.
    pub(crate) fn pose(&mut self, shapes: &[&str]) -> Posed {
        let on: Vec<(&str, f32)> = shapes.iter().map(|s| (*s, 1.0)).collect();
        let weights = pose(&self.face.rig, &on).weights;
        self.weighted(&weights)
    }

    /// With a weight for each shape of the rig.
    pub(crate) fn weighted(&mut self, weights: &[f32]) -> Posed {
        let rig = &self.face.rig;
        let mut posed = pose(rig, &[]);
        posed.weights.copy_from_slice(weights);
        self.simulation.reset(posed).unwrap();
        Posed {
            face: self.face,
            rest: rig.skin_at_rest(),
            now: self.simulation.skin().to_vec(),
            gazes: [RigidBody::EyeLeft, RigidBody::EyeRight]
                .map(|eye| self.simulation.body(eye) * Vector::z()),
        }
    }
}

/// The vertex of a face nearest to a landmark, on the landmark's side of lips and lids.
pub(crate) fn vertex(face: &RiggedFace, landmark: &str) -> usize {
    let template = template::human();
    let mark = template.landmarks[landmark] as usize;
    let region = template.regions.vertex_regions[mark];
    let place = face.registration.positions[mark];
    let distance = |v: usize| {
        let p = face.registration.to_head * face.mesh.positions()[v];
        (p - place).norm()
    };
    (0..face.mesh.vertex_count())
        .filter(|&v| {
            !template
                .regions
                .are_apart(region, face.registration.face_regions[v])
                && !face.is_part(v as u32)
        })
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
        .unwrap()
}

impl Posed {
    /// Motion of a landmark. (mm)
    pub(crate) fn motion(&self, landmark: &str) -> Vector {
        let v = vertex(self.face, landmark);
        (self.now[v] - self.rest[v]).cast()
    }

    /// Distance of two landmarks now, and at rest. (mm)
    pub(crate) fn distances(&self, a: &str, b: &str) -> (f64, f64) {
        let (a, b) = (vertex(self.face, a), vertex(self.face, b));
        let of = |p: &[nalgebra::Point3<f32>]| f64::from((p[a] - p[b]).norm());
        (of(&self.now), of(&self.rest))
    }

    /// Largest motion of any vertex of the skin, and the largest forwards of any part. (mm)
    pub(crate) fn largest(&self) -> (f64, f64) {
        let (mut skin, mut part) = (0.0f64, 0.0f64);
        for (v, (r, n)) in self.rest.iter().zip(&self.now).enumerate() {
            if self.face.is_part(v as u32) {
                part = part.max(f64::from(n.z - r.z));
            } else {
                skin = skin.max(f64::from((n - r).norm()));
            }
        }
        (skin, part)
    }

    /// Largest share of the aperture of an eye that is open now, over all columns between its
    /// corners where it is open by 2 mm or more at rest, and how many columns these are.
    ///
    /// Open is what an onlooker straight ahead sees of the inside: rays towards the face that
    /// meet eyeball, socket or nothing before they meet skin.
    pub(crate) fn open_share(&self, side: &str) -> (f64, usize) {
        const COLUMN: f64 = 0.5;
        const STEP: f64 = 0.05;
        let place = |p: &[nalgebra::Point3<f32>], name: &str| {
            let p = p[vertex(self.face, &format!("{name}_{side}"))];
            Point::from(p.coords.cast())
        };
        let (a, b) = (
            place(&self.rest, "eye_inner"),
            place(&self.rest, "eye_outer"),
        );
        let upper = place(&self.rest, "upper_lid_mid").y + 4.0;
        let lower = place(&self.rest, "lower_lid_mid").y - 4.0;
        let socket = template::human().regions.find(&format!("socket_{side}"));
        let is_inside = |v: u32| {
            self.face.is_part(v) || Some(self.face.registration.face_regions[v as usize]) == socket
        };
        let triangles = self.face.mesh.triangles();
        let inside: Vec<bool> = triangles
            .iter()
            .map(|t| t.iter().any(|&v| is_inside(v)))
            .collect();
        let columns = ((b.x - a.x).abs() / COLUMN) as usize;
        let apertures = |p: &[nalgebra::Point3<f32>]| -> Vec<f64> {
            let points: Vec<Point> = p.iter().map(|p| Point::from(p.coords.cast())).collect();
            let surface = Surface::new(&points, &triangles).unwrap();
            let front = a.z.max(b.z) + 60.0;
            let is_open = |x: f64, y: f64| {
                let hit = surface.cast_ray(&Point::new(x, y, front), &-Vector::z(), 90.0);
                hit.is_none_or(|hit| inside[hit.triangle as usize])
            };
            (1..columns)
                .map(|k| a.x + (b.x - a.x) * k as f64 / columns as f64)
                .map(|x| {
                    let rows = ((upper - lower) / STEP) as usize;
                    let open = (0..rows).filter(|r| is_open(x, lower + *r as f64 * STEP));
                    open.count() as f64 * STEP
                })
                .collect()
        };
        let (now, rest) = (apertures(&self.now), apertures(&self.rest));
        let open = now.iter().zip(&rest).filter(|(_, r)| **r >= 2.0);
        let shares: Vec<f64> = open.map(|(n, r)| n / r).collect();
        (shares.iter().copied().fold(0.0, f64::max), shares.len())
    }

    /// Motion of every skin vertex beside what the template's own shape does at its place.
    /// (mm)
    pub(crate) fn against_drawn(&self, shape: &str) -> Vec<(usize, f64, f64)> {
        let template = template::human();
        let shape = &template.shapes[template.shape_index(shape).unwrap()];
        let drawn = shape.spread(template.skin.vertex_count());
        let triangles = template.skin.triangles();
        (0..self.rest.len())
            .filter(|&v| !self.face.is_part(v as u32))
            .map(|v| {
                let place = &self.face.registration.face_points[v];
                let corners = triangles[place.triangle as usize];
                let most = corners.map(|c| drawn[c as usize].norm());
                let motion = f64::from((self.now[v] - self.rest[v]).norm());
                (v, motion, most.into_iter().fold(0.0, f64::max))
            })
            .collect()
    }
}

/// How the template's own shape moves a landmark. (mm)
pub(crate) fn drawn_motion(shape: &str, landmark: &str) -> Vector {
    let template = template::human();
    let shape = &template.shapes[template.shape_index(shape).unwrap()];
    let found = shape
        .deltas
        .binary_search_by_key(&template.landmarks[landmark], |d| d.0);
    found.map_or_else(|_| Vector::zeros(), |i| shape.deltas[i].1)
}

pub(crate) fn rig_has_tongue(face: &RiggedFace) -> bool {
    face.rig.parts.iter().any(|p| !p.shapes.is_empty())
}

/// Collects what does not hold.
pub(crate) struct Claims {
    pub(crate) face: &'static str,
    pub(crate) broken: Vec<String>,
}

impl Claims {
    pub(crate) fn about(face: &RiggedFace) -> Self {
        Self {
            face: face.name,
            broken: Vec::new(),
        }
    }

    pub(crate) fn more(&mut self, claim: impl Into<String>, value: f64, than: f64) {
        if value.is_nan() || value <= than {
            self.broken
                .push(format!("{}: {value:.2}, not over {than}", claim.into()));
        }
    }

    pub(crate) fn less(&mut self, claim: impl Into<String>, value: f64, than: f64) {
        if value.is_nan() || value >= than {
            self.broken
                .push(format!("{}: {value:.2}, not under {than}", claim.into()));
        }
    }

    pub(crate) fn settle(self) {
        assert!(
            self.broken.is_empty(),
            "on {}:\n{}",
            self.face,
            self.broken.join("\n")
        );
    }
}

/// (suffix of shapes, suffix of landmarks, direction of this side along x)
pub(crate) const SIDES: [(&str, &str, f64); 2] = [("Left", "l", 1.0), ("Right", "r", -1.0)];
