//! More fat and less: a pad as much thicker as is asked for, and the skin over it.
//!
//! A pad of thickness t goes out by `t w`, with w = 1 in its middle and 0 at its rim (with its
//! slope); the skin over it goes out as far as the pad does right under it, along its own normal.
//! The neutral face itself changes, as more fat does, so a thicker pad is at rest. What lies
//! under a pad stays, and so does the face in the template's topology, which is registration's.

use super::EditError;
use crate::anatomy::GridShape;
use crate::mesh::vertex_normals;
use crate::rig::Rig;
use crate::skin::NarrowPatch;
use crate::{Point, Vector};

/// Share of the grid over which the rim rises.
const RIM: f64 = 0.4;
/// Skin is a pad's own up to this share of the height at which it is no longer over it.
const HEIGHT_SHARE: f64 = 0.6;

/// Thickens pads of a rig.
///
/// - `pads`: index among the patches, and how much thicker it is in its middle (mm)
pub(super) fn thicken(rig: &mut Rig, pads: &[(usize, f64)]) -> Result<(), EditError> {
    let mut moved: Vec<(usize, Vec<Point>)> = Vec::new();
    let mut on_skin = Vec::new();
    for &(index, thickness) in pads {
        let patch = &rig.patches[index].patch;
        let grid = patch.chart.grid;
        let lift: Vec<f64> = (0..grid.node_count())
            .map(|node| thickness * window(grid, node as u32))
            .collect();
        let narrow = NarrowPatch::new(patch, 0)?;
        let nodes = patch.neutral.iter().zip(narrow.normals()).zip(&lift);
        let out = nodes.map(|((p, normal), lift)| p + normal * *lift);
        moved.push((index, out.collect()));
        on_skin.push((narrow, lift));
    }
    let carry = |points: &[Point], normals: &[Vector], is_carried: &dyn Fn(usize) -> bool| {
        let pairs = points.iter().zip(normals).enumerate();
        let lifts = pairs.map(|(vertex, (point, normal))| {
            // Pads lie side by side, and where they meet they are thin: lifts add.
            let one = |(pad, lift): &(NarrowPatch<'_>, Vec<f64>)| {
                let footing = pad.under(point, normal)?;
                // Other skin, above or below, stays; between the two it is a slope, not a step.
                let away = (footing.height.abs() - HEIGHT_SHARE) / (1.0 - HEIGHT_SHARE);
                Some((1.0 - smooth(away)) * pad.at(footing.uv, lift))
            };
            if is_carried(vertex) {
                on_skin.iter().filter_map(one).sum()
            } else {
                0.0
            }
        });
        lifts.collect::<Vec<f64>>()
    };
    let skin = rig.face_in_head();
    let normals = vertex_normals(&skin, &rig.face.triangles());
    let is_skin = |v: usize| rig.regions.get(v).is_some_and(Option::is_some);
    let lifts = carry(&skin, &normals, &is_skin);
    let to_own = rig.to_head.inverse();
    let mut positions = rig.face.positions().to_vec();
    for ((position, normal), lift) in positions.iter_mut().zip(&normals).zip(&lifts) {
        if *lift != 0.0 {
            *position += to_own * (normal * *lift);
        }
    }
    let face = rig.face.with_positions(positions)?;
    drop(on_skin);
    rig.face = face;
    for (index, nodes) in moved {
        rig.patches[index].patch.neutral = nodes;
    }
    Ok(())
}

/// 1 in the middle of a grid, 0 at its rim.
fn window(grid: GridShape, node: u32) -> f64 {
    let rise = |k: u32, count: u32| {
        let share = f64::from(k) / f64::from(count.max(2) - 1);
        smooth(share.min(1.0 - share) / RIM)
    };
    let along = if grid.is_periodic {
        1.0
    } else {
        rise(node % grid.u_count, grid.u_count)
    };
    along * rise(node / grid.u_count, grid.v_count)
}

fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
