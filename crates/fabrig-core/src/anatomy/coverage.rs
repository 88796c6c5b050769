//! How much of the moving skin has a patch under it.

use rayon::prelude::*;

use super::patch::PatchChart;
use crate::template::Template;

/// What patches cover of one whole-face shape.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeCoverage {
    /// Name of the shape.
    pub shape: String,
    /// Skin vertices outside the mouth, sockets and nostrils that it moves by more than the
    /// threshold.
    pub moving_count: usize,
    /// Those of them with a patch node under the skin within reach.
    pub covered_count: usize,
    /// Greatest distance from a moving vertex to the nearest place with a patch under it. (mm)
    pub greatest_distance: f64,
    /// The vertex with that distance.
    pub farthest_vertex: u32,
}

/// Regions that are not seen from outside: patches move them through the skin around.
const HIDDEN: [&str; 4] = ["mouth_interior", "socket", "nostril", "ear"];

/// Measures, shape by shape, which moving skin has a patch under it: skin moves only with
/// patches.
///
/// - `threshold`: what counts as moving (mm); `reach`: how near a node must be, measured on
///   the skin above it (mm)
pub fn coverage(
    template: &Template,
    charts: &[PatchChart],
    threshold: f64,
    reach: f64,
) -> Vec<ShapeCoverage> {
    let positions = template.skin.positions();
    let triangles = template.skin.triangles();
    let is_hidden: Vec<bool> = template
        .regions
        .regions
        .iter()
        .map(|r| HIDDEN.iter().any(|h| r.name.starts_with(h)))
        .collect();
    // Only vertices with a face that is seen: those on the seam inside the mouth have none.
    let mut is_seen = vec![false; positions.len()];
    for t in &triangles {
        let hidden = |v: &u32| is_hidden[template.regions.vertex_regions[*v as usize].0 as usize];
        if !t.iter().any(hidden) {
            for &v in t {
                is_seen[v as usize] = true;
            }
        }
    }
    let points: Vec<_> = positions.iter().map(|p| p.coords).collect();
    let places: Vec<_> = charts
        .iter()
        .flat_map(|c| &c.nodes)
        .map(|n| n.blend(&triangles, &points))
        .collect();
    let distances: Vec<f64> = points
        .par_iter()
        .map(|p| {
            places
                .iter()
                .map(|q| (p - q).norm_squared())
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        })
        .collect();
    template
        .shapes
        .iter()
        .map(|shape| {
            let mut result = ShapeCoverage {
                shape: shape.name.clone(),
                moving_count: 0,
                covered_count: 0,
                greatest_distance: 0.0,
                farthest_vertex: 0,
            };
            for &(vertex, delta) in &shape.deltas {
                if delta.norm() <= threshold || !is_seen[vertex as usize] {
                    continue;
                }
                let distance = distances[vertex as usize];
                result.moving_count += 1;
                result.covered_count += usize::from(distance <= reach);
                if distance > result.greatest_distance {
                    result.greatest_distance = distance;
                    result.farthest_vertex = vertex;
                }
            }
            result
        })
        .collect()
}
