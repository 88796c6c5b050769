//! Contact that is asked after several substeps, on the cloth's own solver.

use nalgebra::{Isometry3, Point3, Vector3};

use super::sheet;
use crate::cloth::{Cloth, ClothOptions, ClothPatch, FrameInput, GridShape, Material, PatchMotion};
use crate::collision::{Collider, ColliderShape, Contact, ContactOptions, PairMask};

const DT: f64 = 1.0 / 60.0;
const COUNT: u32 = 12;
const STRIDES: [u32; 4] = [1, 2, 3, 5];

/// A sheet over a plate, which stands where its top is at z = 0.
struct Press {
    cloth: Cloth,
    contact: Contact,
    rest: Vec<Point3<f32>>,
    targets: PatchMotion,
    plate: Isometry3<f64>,
}

impl Press {
    fn new(every: u32, height: f32) -> Self {
        let patch = sheet(COUNT, 30.0, height, 0.0);
        let cloth = ClothPatch {
            shape: GridShape {
                u_count: COUNT,
                v_count: COUNT,
                is_periodic: false,
            },
            rest: patch.rest.clone(),
            material: Material::LINEAR_MUSCLE,
            attachments: Vec::new(),
            variations: Vec::new(),
        };
        // A plane is everything below its own +y.
        let turn = Vector3::x() * std::f64::consts::FRAC_PI_2;
        let plate = Isometry3::new(Vector3::zeros(), turn);
        let mut collider = Collider::at("plate", ColliderShape::Plane {}, Vector3::zeros());
        collider.keys[0].rotation = turn;
        let options = ContactOptions {
            pairs: PairMask::All,
            every,
            ..ContactOptions::default()
        };
        let rest = patch.rest.clone();
        let targets = PatchMotion::still(&rest);
        let mut contact = Contact::new(&[patch], &[], &[collider], &options).unwrap();
        let mut cloth = Cloth::new(&[cloth], &ClothOptions::default()).unwrap();
        contact.begin_frame(&[], &[plate]);
        let still = std::slice::from_ref(&targets);
        cloth.reset_with(still, &[], &mut contact).unwrap();
        Self {
            cloth,
            contact,
            rest,
            targets,
            plate,
        }
    }

    /// A frame in which the targets go to `height` over where they rest.
    fn frame(&mut self, height: f32) {
        for (target, rest) in self.targets.positions.iter_mut().zip(&self.rest) {
            *target = rest + Vector3::z() * height;
        }
        self.contact.begin_frame(&[], &[self.plate]);
        let input = FrameInput::new(DT, std::slice::from_ref(&self.targets));
        self.cloth.step_with(&input, &mut self.contact).unwrap();
    }

    fn heights(&self) -> impl Iterator<Item = f32> {
        self.cloth.positions(0).iter().map(|p| p.z)
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
        let contact = press.contact.report();
        assert_eq!(contact.contacts, press.rest.len());
        // Newtons of nodes of 0.04 g whose magnets are drawn out.
        let node = 0.04e-6 * Material::LINEAR_MUSCLE.magnet_stiffness();
        let lowest = press.heights().fold(f32::INFINITY, f32::min);
        assert!(lowest > -1e-3, "every {every}: {lowest} mm");
        let drawn: f64 = press
            .heights()
            .zip(&press.targets.positions)
            .map(|(z, target)| f64::from(z - target.z))
            .sum();
        let force = -contact.forces[0].z;
        let ratio = force / (node * drawn);
        // Spans of unequal length, as at 2 and 5, are off by the most.
        assert!((ratio - 1.0).abs() < 0.1, "every {every}: {ratio}");
        let kinetic = press.cloth.patch_energies(0).kinetic;
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
