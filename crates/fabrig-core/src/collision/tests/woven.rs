//! Sheets and colliders on the cloth's own solver.

use nalgebra::{Isometry3, Point3};

use super::DT;
use crate::cloth::{Cloth, ClothOptions, ClothPatch, FrameInput, Material, PatchMotion};
use crate::collision::{Collider, Contact, ContactOptions, ContactPatch, PairMask, Verdict};

/// A cloth of sheets whose contact is asked as a scene asks it.
pub(super) struct Woven {
    pub(super) cloth: Cloth,
    pub(super) contact: Contact,
    pub(super) targets: Vec<PatchMotion>,
    colliders: Vec<Collider>,
}

impl Woven {
    /// At rest, colliders where they start; contact asked every `every` substeps.
    pub(super) fn new(sheets: &[ContactPatch], colliders: Vec<Collider>, every: u32) -> Self {
        let patches: Vec<ClothPatch> = sheets.iter().map(woven).collect();
        let options = ContactOptions {
            pairs: PairMask::All,
            every,
            ..ContactOptions::default()
        };
        let targets: Vec<_> = sheets.iter().map(|s| PatchMotion::still(&s.rest)).collect();
        let mut contact = Contact::new(sheets, &[], &colliders, &options).unwrap();
        let mut cloth = Cloth::new(&patches, &ClothOptions::default()).unwrap();
        let poses: Vec<_> = colliders.iter().map(|c| c.pose_at(0.0)).collect();
        contact.begin_frame(&[], &poses);
        cloth.reset_with(&targets, &[], &mut contact).unwrap();
        Self {
            cloth,
            contact,
            targets,
            colliders,
        }
    }

    /// A frame towards new targets of all sheets, one after the other.
    pub(super) fn frame(&mut self, targets: &[Point3<f32>], poses: &[Isometry3<f64>]) -> Verdict {
        let mut left = targets;
        for motion in &mut self.targets {
            let (own, others) = left.split_at(motion.positions.len());
            motion.positions.copy_from_slice(own);
            left = others;
        }
        self.contact.begin_frame(&[], poses);
        let input = FrameInput::new(f64::from(DT), &self.targets);
        self.cloth.step_with(&input, &mut self.contact).unwrap();
        let placed: Vec<_> = self.colliders.iter().zip(poses.iter().copied()).collect();
        let positions = |patch| self.cloth.positions(patch);
        self.contact.judge(positions, &placed).unwrap()
    }
}

fn woven(sheet: &ContactPatch) -> ClothPatch {
    ClothPatch {
        shape: sheet.shape,
        rest: sheet.rest.clone(),
        material: Material::LINEAR_MUSCLE,
        attachments: Vec::new(),
        variations: Vec::new(),
    }
}
