//! What the skin takes of each patch ([`SheetFilter`]).

use nalgebra::Point3;
use rayon::prelude::*;

use crate::anatomy::{Attachment, PatchChart, PatchKind};
use crate::cloth::{NodeVariation, PatchMotion};
use crate::rig::{Rig, RigPatch};
use crate::scene::Scene;
use crate::scene::modelled::Modelled;
use crate::skin::SheetFilter;
use crate::template::RigidBody;

/// Share of a ring's rows, from the opening out, of which skin takes all: lips and lids meet others
/// there. Between the two it takes less and less of what is fine.
const OPENING: [f32; 2] = [0.3, 0.7];
/// Lengths that follow the muscle shapes by the first or less are skin that is to fold, by the second
/// or more skin that is not.
const LOOSE: [f32; 2] = [0.7, 0.85];

/// What lies on an eyeball stays on it: there skin takes all, and this much less with every edge away.
const LESS_BESIDE_EYES: f32 = 0.25;

/// The patches as the skin takes them.
pub(super) struct SkinSheet {
    /// None where the skin takes a patch as it is.
    filters: Vec<Option<SheetFilter>>,
    /// What it takes where there is a filter. (mm)
    taken: Vec<Vec<Point3<f32>>>,
}

impl SkinSheet {
    /// As a scene asks for it.
    pub(super) fn new(rig: &Rig, scene: &Scene, modelled: &Modelled) -> Self {
        let width = scene.skin_smoothing as f32;
        let filter = |(index, patch): (usize, &RigPatch)| {
            modelled.cloth_of(index)?;
            let (chart, nodes) = (&patch.patch.chart, &patch.patch.neutral);
            let variations = rig.variations.get(index).map_or(&[][..], Vec::as_slice);
            let share = shares(chart, variations, scene.cloth.rest_blend as f32);
            let rest: Vec<Point3<f32>> = nodes.iter().map(|q| q.cast()).collect();
            let filter = SheetFilter::new(chart.grid, &rest, width, share);
            (!filter.is_idle()).then_some(filter)
        };
        let filters: Vec<_> = rig.patches.iter().enumerate().map(filter).collect();
        let taken = filters.iter().zip(rig.neutral_nodes());
        let taken = taken.map(|(filter, (_, nodes))| match filter {
            Some(_) => nodes,
            None => Vec::new(),
        });
        Self {
            taken: taken.collect(),
            filters,
        }
    }

    /// What the skin takes of each patch. (mm)
    ///
    /// - `nodes`: of each patch (mm); `targets`: where the muscle shapes want them
    /// - `has_moved`: patches of which it says no are as they were when they were last taken
    pub(super) fn take<'a>(
        &'a mut self,
        nodes: &[&'a [Point3<f32>]],
        targets: &[PatchMotion],
        has_moved: impl Fn(usize) -> bool + Sync,
    ) -> Vec<&'a [Point3<f32>]> {
        let all = self.filters.par_iter_mut().zip(&mut self.taken);
        all.zip(nodes.par_iter().zip(targets))
            .enumerate()
            .map(|(patch, ((filter, taken), (nodes, target)))| match filter {
                Some(filter) => {
                    if has_moved(patch) {
                        filter.apply(nodes, &target.positions, taken);
                    }
                    &taken[..]
                }
                None => nodes,
            })
            .collect()
    }
}

/// How much is filtered at each node of a patch, 0 to 1.
///
/// - `variations`: of its nodes, or none
/// - `rest_blend`: of the cloth
fn shares(chart: &PatchChart, variations: &[NodeVariation], rest_blend: f32) -> Vec<f32> {
    let rows = (chart.grid.v_count.max(2) - 1) as f32;
    let share = |node: usize| {
        let blend = rest_blend * variations.get(node).map_or(1.0, |v| v.rest_blend);
        let firm = smooth_step(blend, LOOSE);
        if chart.kind == PatchKind::Sphincter {
            let outwards = (node as u32 / chart.grid.u_count) as f32 / rows;
            firm * smooth_step(outwards, OPENING)
        } else {
            firm
        }
    };
    let mut shares: Vec<f32> = (0..chart.grid.node_count()).map(share).collect();
    for attachment in &chart.attachments {
        if let Attachment::Body {
            body: RigidBody::EyeLeft | RigidBody::EyeRight,
            nodes,
            ..
        } = attachment
        {
            nodes.iter().for_each(|&node| shares[node as usize] = 0.0);
        }
    }
    let quads = chart.grid.quads();
    for _ in 0..(1.0 / LESS_BESIDE_EYES) as u32 {
        let before = shares.clone();
        for quad in &quads {
            let least = quad.iter().map(|&n| before[n as usize]).fold(1.0, f32::min);
            for &node in quad {
                let share = &mut shares[node as usize];
                *share = share.min(least + LESS_BESIDE_EYES);
            }
        }
    }
    shares
}

/// 0 up to the first bound, 1 from the second.
fn smooth_step(x: f32, [low, high]: [f32; 2]) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
