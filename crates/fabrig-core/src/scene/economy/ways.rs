//! What of a rig thrift has to know: how far shapes move patches, and who is tied to whom.

use crate::anatomy::Attachment;
use crate::cloth::PatchMotion;
use crate::rig::Rig;
use crate::scene::SceneError;
use crate::scene::anchors::{BoneAnchors, Mandible};
use crate::transfer::ShapeWeights;

/// Nodes of another patch that a patch is paired with.
pub(super) struct Tie {
    pub(super) patch: usize,
    pub(super) nodes: Vec<u32>,
}

/// What a patch is tied to.
#[derive(Default)]
pub(super) struct Ties {
    pub(super) partners: Vec<Tie>,
    /// Strength of the strongest tie, to partners or bones, against the stretch of the patch.
    pub(super) strength: f64,
}

/// The ties of every patch: pairs are declared on one side and act on both.
pub(super) fn ties(rig: &Rig) -> Vec<Ties> {
    let mut out: Vec<Ties> = rig.patches.iter().map(|_| Ties::default()).collect();
    for (own, patch) in rig.patches.iter().enumerate() {
        for attachment in &patch.patch.chart.attachments {
            let mut tie = |from: usize, tie: Option<Tie>, strength: f64| {
                out[from].strength = out[from].strength.max(strength);
                out[from].partners.extend(tie);
            };
            match attachment {
                Attachment::Body { strength, .. } => tie(own, None, *strength),
                Attachment::Patch {
                    patch,
                    pairs,
                    strength,
                } => {
                    let other = *patch as usize;
                    let ends = |end: fn(&(u32, u32)) -> u32| pairs.iter().map(end).collect();
                    let there = Tie {
                        patch: other,
                        nodes: ends(|pair| pair.1),
                    };
                    let here = Tie {
                        patch: own,
                        nodes: ends(|pair| pair.0),
                    };
                    tie(own, Some(there), *strength);
                    tie(other, Some(here), *strength);
                }
            }
        }
    }
    out
}

/// For each patch the shapes that move it, with the root mean square way of its nodes, or of its
/// anchors where that is more, at weight 1. (mm)
pub(super) fn ways_of_shapes(
    rig: &Rig,
    anchored: &[BoneAnchors],
) -> Result<Vec<Vec<(u32, f64)>>, SceneError> {
    let count = rig.shape_names.len();
    let still = vec![0.0; count];
    let mut targets = vec![(Vec::new(), Vec::new()); rig.patches.len()];
    let mut at = |weights: &[f32]| -> Result<Vec<[PatchMotion; 2]>, SceneError> {
        let at = ShapeWeights {
            weights,
            rates: Some(&still),
        };
        rig.targets(at, &mut targets)?;
        let mandible = Mandible::at(rig, weights, &still);
        let placed = targets.iter().zip(anchored);
        let placed = placed.map(|((positions, velocities), anchored)| {
            let target = PatchMotion {
                positions: positions.clone(),
                velocities: velocities.clone(),
            };
            let mut anchors = PatchMotion::default();
            anchored.place(&mandible, &target, &mut anchors);
            [target, anchors]
        });
        Ok(placed.collect())
    };
    let rest = at(&still)?;
    let mut out = vec![Vec::new(); rig.patches.len()];
    let mut weights = still.clone();
    for shape in 0..count {
        weights[shape] = 1.0;
        let moved = at(&weights)?;
        weights[shape] = 0.0;
        for ((list, rest), moved) in out.iter_mut().zip(&rest).zip(&moved) {
            let ends = rest.iter().zip(moved);
            let way = ends
                .map(|(a, b)| rms_distance(&a.positions, &b.positions))
                .fold(0.0, f64::max);
            if way > 0.0 {
                list.push((shape as u32, way));
            }
        }
    }
    Ok(out)
}

/// Root mean square distance of points. (mm)
pub(super) fn rms_distance(a: &[nalgebra::Point3<f32>], b: &[nalgebra::Point3<f32>]) -> f64 {
    let sum: f64 = a
        .iter()
        .zip(b)
        .map(|(p, q)| f64::from((p - q).norm_squared()))
        .sum();
    (sum / a.len().max(1) as f64).sqrt()
}
