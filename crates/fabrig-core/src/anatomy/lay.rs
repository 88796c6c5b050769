//! Laying charted patches under a face: q = p - s d n.

use rayon::prelude::*;

use super::error::AnatomyError;
use super::patch::{GridShape, Patch, PatchChart, Resolution, SurfaceNode};
use super::skin_frame::SkinFrame;
use crate::template::Template;
use crate::{Point, Vector};

/// How far a ray looks for the other side of the skin. [mm on the template]
const THICKNESS_REACH: f64 = 40.0;

/// Thickness that is taken as given where the skin is thinner or folded onto itself (lids,
/// fused lips): patches stay this deep at most, but never on the surface. [mm on the template]
const LEAST_THICKNESS: f64 = 1.2;

/// Rounds of averaging that normals go through within each grid at standard resolution, so
/// that a patch bends less than the skin over it where that is finely folded (corners of mouth
/// and eyes). Averaging spreads with the square root of the rounds: at other resolutions there
/// are as many as spread equally far.
const EVENING_ROUNDS: f64 = 4.0;

/// Lays every chart under a face that has the template's topology.
///
/// - `positions`: the face, shape [template vertex_count, 3], mm in the head frame
///
/// Node by node q = p - s d n: p on the skin, n the smoothed outward normal, d the
/// charted depth and s the square root of how much larger the skin around is than the
/// template's. Depth saturates at half the distance to the skin on the other side, in such a
/// way that what is deeper on the template stays deeper.
///
/// A mirrored face gives mirrored patches, bit for bit.
///
/// # Errors
///
/// [`AnatomyError`] when positions do not fit the template, are not finite, or a chart names
/// a triangle that does not exist.
pub fn lay_patches(
    template: &Template,
    charts: &[PatchChart],
    positions: &[Point],
) -> Result<Vec<Patch>, AnatomyError> {
    check(template, charts, positions)?;
    let nodes: Vec<_> = charts
        .iter()
        .map(|c| (c.grid, c.nodes.as_slice()))
        .collect();
    // Each node is computed on the side where its chart was drawn; the other side is the same
    // computation on the mirrored face. So rounding cannot differ between the two.
    let as_is = lay_nodes(template, positions, &nodes)?;
    let mirrored_face = mirror_positions(template, positions);
    let swapped: Vec<_> = charts
        .iter()
        .map(|c| (c.grid, charts[c.mirror as usize].nodes.as_slice()))
        .collect();
    let mirrored = lay_nodes(template, &mirrored_face, &swapped)?;

    Ok(charts
        .iter()
        .enumerate()
        .map(|(index, chart)| {
            let is_drawn = |node: usize| {
                let image = chart.mirror_node(node);
                (index, node) <= (chart.mirror as usize, image)
            };
            let neutral = (0..chart.nodes.len())
                .map(|node| {
                    if is_drawn(node) {
                        as_is[index][node]
                    } else {
                        let q = mirrored[index][chart.mirror_node(node)];
                        Point::new(-q.x, q.y, q.z)
                    }
                })
                .collect();
            Patch {
                chart: chart.clone(),
                neutral,
            }
        })
        .collect())
}

/// The face seen in a mirror, in the template's vertex order.
pub(super) fn mirror_positions(template: &Template, positions: &[Point]) -> Vec<Point> {
    template
        .mirror
        .iter()
        .map(|&m| {
            let p = positions[m as usize];
            Point::new(-p.x, p.y, p.z)
        })
        .collect()
}

fn check(
    template: &Template,
    charts: &[PatchChart],
    positions: &[Point],
) -> Result<(), AnatomyError> {
    if positions.len() != template.skin.vertex_count() {
        return Err(AnatomyError::PositionCount {
            expected: template.skin.vertex_count(),
            found: positions.len(),
        });
    }
    let triangle_count = template.skin.triangles().len();
    for chart in charts {
        let foreign = |n: &SurfaceNode| n.triangle as usize >= triangle_count;
        if let Some(node) = chart.nodes.iter().position(foreign) {
            return Err(AnatomyError::ForeignChart {
                patch: chart.name.clone(),
                node,
                triangle: chart.nodes[node].triangle,
                triangle_count,
            });
        }
    }
    Ok(())
}

fn lay_nodes(
    template: &Template,
    positions: &[Point],
    patches: &[(GridShape, &[SurfaceNode])],
) -> Result<Vec<Vec<Point>>, AnatomyError> {
    let triangles = template.skin.triangles();
    let drawn = SkinFrame::new(template.skin.positions(), &triangles)?;
    let face = SkinFrame::new(positions, &triangles)?;
    Ok(patches
        .par_iter()
        .map(|&(grid, nodes)| {
            let mut normals: Vec<Vector> = nodes
                .iter()
                .map(|n| face.normal(n.triangle, n.barycentric))
                .collect();
            for _ in 0..evening_rounds(grid) {
                normals = even_out(grid, &normals);
            }
            nodes
                .iter()
                .zip(&normals)
                .map(|(node, normal)| lay_node(&drawn, &face, node, normal))
                .collect()
        })
        .collect())
}

fn evening_rounds(grid: GridShape) -> usize {
    let [u_count, v_count] = if grid.is_periodic {
        Resolution::STANDARD.ring
    } else {
        Resolution::STANDARD.sheet
    };
    let finer = f64::from(grid.u_count * grid.v_count) / f64::from(u_count * v_count);
    (EVENING_ROUNDS * finer).round() as usize
}

/// One round: every direction becomes half itself, half the mean of its neighbours in the
/// grid.
fn even_out(grid: GridShape, directions: &[Vector]) -> Vec<Vector> {
    let (u_count, v_count) = (grid.u_count, grid.v_count);
    let mut out = Vec::with_capacity(directions.len());
    for v in 0..v_count {
        for u in 0..u_count {
            let at = |u: u32, v: u32| directions[grid.index(u, v)];
            let own = at(u, v);
            let (before, after) = if grid.is_periodic {
                (at((u + u_count - 1) % u_count, v), at((u + 1) % u_count, v))
            } else {
                (at(u.saturating_sub(1), v), at((u + 1).min(u_count - 1), v))
            };
            // Pairs first: a sum of two does not depend on their order, so mirror images
            // round alike.
            let along = before + after;
            let across = at(u, v.saturating_sub(1)) + at(u, (v + 1).min(v_count - 1));
            let mean = own * 4.0 + (along + across);
            out.push(mean.try_normalize(0.0).unwrap_or(own));
        }
    }
    out
}

fn lay_node(drawn: &SkinFrame, face: &SkinFrame, node: &SurfaceNode, normal: &Vector) -> Point {
    let (triangle, barycentric) = (node.triangle, node.barycentric);
    let p = face.surface.point_at(triangle, barycentric);
    let area = drawn.area(triangle, barycentric);
    let scale = if area > 0.0 {
        (face.area(triangle, barycentric) / area).sqrt()
    } else {
        1.0
    };
    let depth = scale * node.depth;
    let depth = match face.thickness(&p, normal, scale, THICKNESS_REACH) {
        Some(thickness) => saturate(depth, 0.5 * thickness.max(LEAST_THICKNESS * scale)),
        None => depth,
    };
    p - normal * depth
}

/// `depth` held below `limit`: close to itself while it is small, and always rising, so that
/// layers keep their order.
fn saturate(depth: f64, limit: f64) -> f64 {
    let ratio = depth / limit;
    depth / (1.0 + ratio.powi(4)).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saturation_keeps_small_depths_and_order_and_stays_below_the_limit() {
        assert!((saturate(1.0, 10.0) - 1.0).abs() < 1e-4);
        let depths: Vec<f64> = (1..100)
            .map(|k| saturate(f64::from(k) * 0.3, 4.0))
            .collect();
        assert!(depths.windows(2).all(|d| d[0] < d[1]));
        assert!(depths.iter().all(|d| *d < 4.0));
    }
}
