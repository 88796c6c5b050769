//! How far a patch is stretched along its fibres.

use nalgebra::Point3;

use crate::anatomy::Patch;

/// Stretch of every node along u, the way the fibres run: the mean of its two edges' lengths
/// over their lengths at rest, less one. Nodes whose edges have no length at rest get 0.
///
/// - `nodes`: positions now, one per node (mm)
pub(super) fn fibre_strain(patch: &Patch, nodes: &[Point3<f32>]) -> Vec<f32> {
    let grid = patch.chart.grid;
    let edges = if grid.is_periodic {
        grid.u_count
    } else {
        grid.u_count.saturating_sub(1)
    };
    let mut sums = vec![(0.0f32, 0.0f32); nodes.len()];
    for v in 0..grid.v_count {
        for u in 0..edges {
            let ends = [grid.index(u, v), grid.index((u + 1) % grid.u_count, v)];
            let [a, b] = ends.map(|node| patch.neutral[node]);
            let rest = (b - a).norm() as f32;
            if rest > 0.0 {
                let [a, b] = ends.map(|node| nodes[node]);
                let stretch = (b - a).norm() / rest - 1.0;
                for node in ends {
                    sums[node].0 += stretch;
                    sums[node].1 += 1.0;
                }
            }
        }
    }
    sums.iter()
        .map(|&(sum, n)| if n > 0.0 { sum / n } else { 0.0 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{Resolution, charts, lay_patches};
    use crate::template::human;

    #[test]
    fn a_patch_twice_as_large_is_stretched_by_one() {
        let template = human();
        let charts = charts(template, Resolution::STANDARD).expect("charts");
        let patches = lay_patches(template, &charts, template.skin.positions()).expect("laid");
        for patch in [&patches[0], &patches[patches.len() - 1]] {
            let scaled = |s: f64| -> Vec<Point3<f32>> {
                let nodes = patch.neutral.iter();
                nodes.map(|p| (p * s).cast::<f32>()).collect()
            };
            for (s, stretch) in [(1.0, 0.0f32), (2.0, 1.0), (0.75, -0.25)] {
                for found in fibre_strain(patch, &scaled(s)) {
                    assert!((found - stretch).abs() < 2e-3, "{found} {stretch}");
                }
            }
        }
    }
}
