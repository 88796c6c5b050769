//! Random sheets, motions and colliders.

use nalgebra::{Isometry3, Point3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::woven::Woven;
use super::{Scene, crossings_of, sheet};
use crate::collision::{Collider, ColliderShape, ContactOptions, ContactPatch};
use crate::{Point, Vector};

/// Frames of a scene.
const FRAMES: usize = 14;

/// A shape, a size and a way of its own for every seed.
fn random_collider(random: &mut ChaCha8Rng, index: usize) -> Collider {
    let mut size = || random.random_range(2.0..7.0);
    let shape = match index % 4 {
        0 => ColliderShape::Ball { radius: size() },
        1 => ColliderShape::Capsule {
            half_length: size(),
            radius: size(),
        },
        2 => ColliderShape::Cuboid {
            half_extents: Vector::new(size(), 0.1 * size(), size()),
        },
        _ => ColliderShape::ConvexHull {
            points: (0..8)
                .map(|_| Point::new(size() - 4.5, size() - 4.5, size() - 4.5))
                .collect(),
        },
    };
    Collider::at("it", shape, Vector::new(0.0, 0.0, 60.0))
}

/// Three sheets and a collider, and where both go frame by frame.
struct Story {
    sheets: Vec<ContactPatch>,
    collider: Collider,
    frames: Vec<(Vec<Point3<f32>>, Isometry3<f64>)>,
}

impl Story {
    fn new(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let heights = [2.0, 0.7, -0.7];
        let sheets: Vec<ContactPatch> = heights
            .iter()
            .map(|h| {
                sheet(
                    random.random_range(7..12),
                    24.0,
                    *h,
                    random.random_range(0.5..4.0),
                )
            })
            .collect();
        let collider = random_collider(&mut random, seed as usize);
        let rest: Vec<_> = sheets.iter().flat_map(|s| s.rest.clone()).collect();
        let mut position = Vector::new(0.0, 0.0, 60.0);
        let frames = (0..FRAMES).map(|frame| {
            let mut wave = || random.random_range(-1.0..1.0_f32);
            let (a, b, c, d) = (wave(), wave(), wave(), wave());
            let targets = rest.iter().map(|p| {
                let lift = 6.0 * a * (0.3 * p.x + 3.0 * b).sin() * (1.0 - p.z * c);
                Point3::new(p.x * (1.0 + 0.4 * d), p.y, p.z * (1.0 + 3.0 * c) + lift)
            });
            let targets = targets.collect();
            let mut jump = |size: f64| random.random_range(-size..size);
            let goal = Vector::new(jump(10.0), jump(10.0), jump(6.0));
            // Up to 10 m/s, that is 167 mm a frame.
            position = if frame == 0 { position } else { goal };
            let turn = Vector::new(jump(0.5), jump(0.5), jump(0.5));
            (targets, Isometry3::new(position, turn))
        });
        let frames = frames.collect();
        Self {
            sheets,
            collider,
            frames,
        }
    }
}

#[test]
fn nothing_crosses_in_random_scenes() {
    // Many are for a night; a few tell of a mistake.
    let asked = std::env::var("FABRIG_CONTACT_SCENES").ok();
    let count: u64 = asked.and_then(|text| text.parse().ok()).unwrap_or(8);
    // In scene 53 hundreds of nodes are carried along.
    for seed in (0..count).chain((count <= 53).then_some(53)) {
        let story = Story::new(seed);
        // An integrator that resists nothing, and the cloth's own with the stride that scenes have.
        let mut bare = Scene::new(story.sheets.clone(), vec![story.collider.clone()]);
        let every = ContactOptions::default().every;
        let mut woven = Woven::new(&story.sheets, vec![story.collider.clone()], every);
        for (frame, (targets, pose)) in story.frames.iter().enumerate() {
            let (verdict, _) = bare.frame(targets, &[*pose]);
            let report = bare.contact.report();
            let place = format!("seed {seed}, frame {frame}");
            assert_eq!(crossings_of(verdict), 0, "{place}: {verdict:?}, {report:?}");
            let verdict = woven.frame(targets, &[*pose]);
            let report = woven.contact.report();
            assert_eq!(
                crossings_of(verdict),
                0,
                "{place}, woven: {verdict:?}, {report:?}"
            );
        }
    }
}
