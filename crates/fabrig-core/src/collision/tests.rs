//! Sheets of nodes on magnets, driven as hard as can be, judged by the exact test.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on should fail there"
)]

mod random;
mod strides;
mod woven;

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Collider, ColliderShape, Contact, ContactOptions, ContactPatch, PairMask, Verdict};
use crate::anatomy::GridShape;
use crate::cloth::{HookSubstep, SubstepHook};
use crate::{Point, Vector};

const SUBSTEPS: usize = 8;
const DT: f32 = 1.0 / 60.0;

fn sheet(count: u32, size: f32, height: f32, cover: f32) -> ContactPatch {
    let at = |k: u32| k as f32 / (count - 1) as f32 * size - size / 2.0;
    let rest: Vec<Point3<f32>> = (0..count * count)
        .map(|i| Point3::new(at(i % count), at(i / count) + 0.1 * height, height))
        .collect();
    ContactPatch {
        shape: GridShape {
            u_count: count,
            v_count: count,
            is_periodic: false,
        },
        cover: vec![cover; rest.len()],
        rest,
        attached_to: Vec::new(),
        is_ring: false,
        is_mouth: false,
        node_mass: 0.04,
        bodies: Vec::new(),
    }
}

struct Scene {
    contact: Contact,
    patches: Vec<ContactPatch>,
    colliders: Vec<Collider>,
    positions: Vec<Point3<f32>>,
    velocities: Vec<Vector3<f32>>,
    targets: Vec<Point3<f32>>,
}

impl Scene {
    fn new(patches: Vec<ContactPatch>, colliders: Vec<Collider>) -> Self {
        let options = ContactOptions {
            pairs: PairMask::All,
            ..ContactOptions::default()
        };
        let mut contact = Contact::new(&patches, &[], &colliders, &options).unwrap();
        let mut positions: Vec<_> = patches.iter().flat_map(|p| p.rest.clone()).collect();
        let targets = positions.clone();
        let poses: Vec<_> = colliders.iter().map(|c| c.pose_at(0.0)).collect();
        contact.begin_frame(&[], &poses);
        contact.reset(&mut positions);
        Self {
            velocities: vec![Vector3::zeros(); positions.len()],
            contact,
            patches,
            colliders,
            positions,
            targets,
        }
    }

    /// A frame towards new targets; returns the verdict and the kinetic energy.
    fn frame(&mut self, targets: &[Point3<f32>], poses: &[Isometry3<f64>]) -> (Verdict, f64) {
        self.contact.begin_frame(&[], poses);
        let h = DT / SUBSTEPS as f32;
        let (stiffness, damping) = (5685.0, 120.0);
        for k in 0..SUBSTEPS {
            let s = (k + 1) as f32 / SUBSTEPS as f32;
            let old = self.positions.clone();
            let nodes = self.positions.iter_mut().zip(&self.velocities);
            for ((x, v), (a, b)) in nodes.zip(self.targets.iter().zip(targets)) {
                let target = a + (b - a) * s;
                let pull = (target - *x) * stiffness + (b - a) * (damping / DT);
                *x += (v + pull * h) * (h / (1.0 + damping * h + stiffness * h * h));
            }
            let substep = HookSubstep {
                progress: [k, k + 1].map(|i| i as f64 / SUBSTEPS as f64),
                h: f64::from(h),
                h_e: f64::from(h),
                effective_mass: 1.2,
            };
            self.contact.correct(&substep, &self.positions);
            for moved in self.contact.moved() {
                self.positions[moved.node as usize] = moved.to;
            }
            for (v, (x, o)) in self
                .velocities
                .iter_mut()
                .zip(self.positions.iter().zip(&old))
            {
                *v = (x - o) / h;
            }
        }
        self.targets = targets.to_vec();
        let mut parts = Vec::new();
        let mut rest = self.positions.as_slice();
        for p in &self.patches {
            let (own, others) = rest.split_at(p.rest.len());
            parts.push(own);
            rest = others;
        }
        let placed: Vec<_> = self.colliders.iter().zip(poses.iter().copied()).collect();
        let verdict = self.contact.judge(|p| parts[p], &placed).unwrap();
        let kinetic = self
            .velocities
            .iter()
            .map(|v| f64::from(v.norm_squared()))
            .sum();
        (verdict, kinetic)
    }
}

fn crossings_of(v: Verdict) -> usize {
    v.cloth + v.colliders
}

#[test]
fn sheets_that_are_told_to_swap_sides_stay_on_theirs() {
    let mut scene = Scene::new(
        vec![sheet(10, 20.0, 1.0, 2.0), sheet(11, 20.0, -1.0, 2.0)],
        vec![],
    );
    let targets: Vec<_> = scene
        .targets
        .iter()
        .map(|p| Point3::new(p.x, p.y, -6.0 * p.z))
        .collect();
    for frame in 0..12 {
        let (verdict, _) = scene.frame(&targets, &[]);
        assert_eq!(crossings_of(verdict), 0, "frame {frame}: {verdict:?}");
    }
    assert!(scene.contact.report().contacts > 50);
}

/// Flies a shape into two sheets, presses, and draws it aside.
fn fly(shape: ColliderShape, speed: f64, reach: f64) -> (Scene, f64) {
    let start = Vector::new(0.7, 0.4, 120.0);
    let collider = Collider::at("it", shape, start);
    let patches = vec![sheet(14, 28.0, 1.0, 3.0), sheet(14, 28.0, -1.0, 5.0)];
    let mut scene = Scene::new(patches, vec![collider]);
    let targets = scene.targets.clone();
    let (mut z, mut largest) = (start.z, 0.0_f64);
    for frame in 0..30 {
        z = (z - speed / 60.0).max(reach + 1.0 - 6.0);
        let aside = 0.3 * f64::from((frame - 20_i32).max(0));
        let pose = Isometry3::translation(start.x + aside, start.y, z);
        let (verdict, _) = scene.frame(&targets, &[pose]);
        assert_eq!(crossings_of(verdict), 0, "frame {frame}: {verdict:?}");
        assert_eq!(scene.contact.report().pinched, 0);
        largest = largest.max(scene.contact.report().forces[0].z);
    }
    (scene, largest)
}

#[test]
fn a_sharp_thing_at_10_m_per_s_is_caught() {
    let points = [
        [0.0, 0.0, -10.0],
        [4.0, 4.0, 10.0],
        [-4.0, 4.0, 10.0],
        [4.0, -4.0, 10.0],
        [-4.0, -4.0, 10.0],
    ];
    let hull = ColliderShape::ConvexHull {
        points: points.map(Point::from).to_vec(),
    };
    let (_, force) = fly(hull, 10_000.0, 10.0);
    assert!(force > 0.0, "the face pushes it back out, along +z");
}

#[test]
fn a_thin_plate_at_5_m_per_s_is_caught() {
    let plate = ColliderShape::Cuboid {
        half_extents: Vector::new(8.0, 0.25, 8.0),
    };
    let (_, force) = fly(plate, 5_000.0, 8.0);
    assert!(force > 0.0);
}

#[test]
fn a_held_press_comes_to_rest() {
    let finger = ColliderShape::Capsule {
        half_length: 10.0,
        radius: 6.0,
    };
    let (mut scene, force) = fly(finger, 5_000.0, 6.0);
    assert!(force > 0.0);
    let pose = Isometry3::translation(3.4, 0.4, 1.0);
    let targets = scene.targets.clone();
    let mut kinetic = f64::INFINITY;
    for _ in 0..60 {
        kinetic = scene.frame(&targets, &[pose]).1;
    }
    // 400 nodes that each move less than half a millimetre a second.
    assert!(kinetic < 100.0, "{kinetic} mm^2/s^2");
}

#[test]
fn what_starts_inside_is_let_out_and_said() {
    let ball = Collider::at(
        "ball",
        ColliderShape::Ball { radius: 8.0 },
        Vector::new(1.0, 2.0, 2.0),
    );
    let mut scene = Scene::new(vec![sheet(14, 28.0, 0.0, 2.0)], vec![ball]);
    let report = scene.contact.report();
    assert!(report.started_inside > 20);
    assert!(report.started_depth > 3.0);
    let targets = scene.targets.clone();
    let pose = scene.colliders[0].pose_at(0.0);
    for frame in 0..10 {
        let (verdict, kinetic) = scene.frame(&targets, &[pose]);
        assert_eq!(crossings_of(verdict), 0, "frame {frame}");
        assert!(kinetic < 1e7, "frame {frame}: {kinetic}");
    }
}

#[test]
fn half_the_length_in_one_frame_folds_nothing_through() {
    let mut scene = Scene::new(
        vec![sheet(14, 28.0, 0.6, 2.0), sheet(13, 28.0, -0.6, 2.0)],
        vec![],
    );
    let targets: Vec<_> = scene
        .targets
        .iter()
        .map(|p| Point3::new(0.5 * p.x, p.y, -p.z))
        .collect();
    for frame in 0..12 {
        let (verdict, _) = scene.frame(&targets, &[]);
        assert_eq!(crossings_of(verdict), 0, "frame {frame}: {verdict:?}");
    }
}
