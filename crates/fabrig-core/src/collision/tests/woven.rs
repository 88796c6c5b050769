//! Sheets and colliders on the cloth's own solver.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{DT, crossings_of, sheet};
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

/// What the targets go in a frame: as fast as a jaw that drops. (mm)
const WAY: f32 = 0.8;

/// Two sheets that rest on each other to a micrometre are drawn through each other by a wave while
/// both go their way: what blocks itself must go along.
#[test]
fn sheets_that_block_each_other_go_where_both_are_drawn() {
    let sheets = [sheet(12, 22.0, 5e-4, 2.0), sheet(13, 22.0, -5e-4, 2.0)];
    let rest: Vec<Vec<Point3<f32>>> = sheets.iter().map(|s| s.rest.clone()).collect();
    let every = ContactOptions::default().every;
    let mut woven = Woven::new(&sheets, Vec::new(), every);
    let mut furthest = 0.0_f32;
    for frame in 0..40 {
        let way = WAY * frame as f32;
        let targets: Vec<_> = rest
            .iter()
            .zip([1.0, -1.0])
            .flat_map(|(sheet, side)| {
                sheet.iter().map(move |p| {
                    let wave = (0.5 * p.x + 0.4 * frame as f32).sin() * (0.6 * p.y).cos();
                    p + Vector3::new(0.2 * side * wave, way, 0.6 * side * wave)
                })
            })
            .collect();
        let verdict = woven.frame(&targets, &[]);
        assert_eq!(crossings_of(verdict), 0, "frame {frame}: {verdict:?}");
        let positions = (0..2).flat_map(|patch| woven.cloth.positions(patch));
        let away = positions.zip(&targets).map(|(x, t)| (x - t).norm());
        furthest = away.fold(furthest, f32::max);
    }
    // Without contact it is 0.3 mm.
    assert!(furthest < 2.0 * WAY, "{furthest} mm behind");
}
