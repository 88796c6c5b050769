//! Contact that is asked after several substeps, on the cloth's own solver.

use nalgebra::{Isometry3, Point3, Vector3};

use super::sheet;
use super::woven::Woven;
use crate::cloth::Material;
use crate::collision::{Collider, ColliderShape};

const COUNT: u32 = 12;
const STRIDES: [u32; 4] = [1, 2, 3, 5];

/// A sheet over a plate, which stands where its top is at z = 0.
struct Press {
    woven: Woven,
    rest: Vec<Point3<f32>>,
    plate: Isometry3<f64>,
}

impl Press {
    fn new(every: u32, height: f32) -> Self {
        let patch = sheet(COUNT, 30.0, height, 0.0);
        // A plane is everything below its own +y.
        let turn = Vector3::x() * std::f64::consts::FRAC_PI_2;
        let mut collider = Collider::at("plate", ColliderShape::Plane {}, Vector3::zeros());
        collider.keys[0].rotation = turn;
        let rest = patch.rest.clone();
        Self {
            woven: Woven::new(&[patch], vec![collider], every),
            rest,
            plate: Isometry3::new(Vector3::zeros(), turn),
        }
    }

    /// A frame in which the targets go to `height` over where they rest.
    fn frame(&mut self, height: f32) {
        let targets = self.rest.iter().map(|rest| rest + Vector3::z() * height);
        let targets: Vec<_> = targets.collect();
        self.woven.frame(&targets, &[self.plate]);
    }

    fn heights(&self) -> impl Iterator<Item = f32> {
        self.woven.cloth.positions(0).iter().map(|p| p.z)
    }
}

#[test]
fn a_held_press_pushes_as_hard_as_its_magnets_pull_and_comes_to_rest() {
    let (start, depth) = (1.0, 1.5);
    for every in STRIDES {
        let mut press = Press::new(every, start);
        for frame in 0..180 {
            // Down in a fifth of a second, then held.
            press.frame(-depth * (frame as f32 / 12.0).min(1.0));
        }
        let contact = press.woven.contact.report();
        assert_eq!(contact.contacts, press.rest.len());
        // Newtons of nodes of 0.04 g whose magnets are drawn out.
        let node = 0.04e-6 * Material::LINEAR_MUSCLE.magnet_stiffness();
        let lowest = press.heights().fold(f32::INFINITY, f32::min);
        assert!(lowest > -1e-3, "every {every}: {lowest} mm");
        let drawn: f64 = press
            .heights()
            .zip(&press.woven.targets[0].positions)
            .map(|(z, target)| f64::from(z - target.z))
            .sum();
        let force = -contact.forces[0].z;
        let ratio = force / (node * drawn);
        // Spans of unequal length, as at 2 and 5, are off by the most.
        assert!((ratio - 1.0).abs() < 0.1, "every {every}: {ratio}");
        let kinetic = press.woven.cloth.patch_energies(0).kinetic;
        assert!(kinetic < 1e-3, "every {every}: {kinetic}");
    }
}

#[test]
fn a_sheet_that_is_thrown_on_a_plate_does_not_bounce() {
    for every in STRIDES {
        // Friction holds it as unevenly as it landed; what bounced would be back at its height.
        let mut press = Press::new(every, 8.0);
        // Through the plate within two frames.
        let mut highest = f32::NEG_INFINITY;
        for frame in 0..40 {
            press.frame(-12.0 * (frame as f32 / 2.0).min(1.0));
            let heights: Vec<f32> = press.heights().collect();
            let lowest = heights.iter().copied().fold(f32::INFINITY, f32::min);
            assert!(lowest > -1e-3, "every {every}, frame {frame}: {lowest} mm");
            if frame >= 10 {
                highest = heights.into_iter().fold(highest, f32::max);
            }
        }
        assert!(highest < 0.4, "every {every}: {highest} mm");
    }
}
