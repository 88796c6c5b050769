//! Checks of a laid grid: no fold, no nodes on top of each other.

use super::error::AnatomyError;
use super::patch::{Patch, Resolution, Side};
use super::skin_frame::SkinFrame;
use crate::Vector;

/// Least distance between neighbours, relative to the mean distance in the grid.
const LEAST_SPACING: f64 = 0.02;

/// Cosine between a quad's normal and the skin's below which the quad counts as folded. At
/// the margins of lips and lids the skin turns inwards within a row, so that a sound quad may
/// stand at a right angle to it; a fold turns all the way.
const FOLDED: f64 = -0.5;

/// Checks a grid laid on the template.
///
/// Up to the standard resolution no quad may be folded but one in a hundred in the first row, at
/// the margin of lips and lids, where a registered face has facets of any shape. Of the quads
/// that a finer grid has more, one in a hundred may anywhere: there they are smaller than the
/// skin's own facets, and two neighbours may lie on either side of a crease.
///
/// # Errors
///
/// [`AnatomyError::Folded`] where a quad faces inwards, [`AnatomyError::TooClose`] where
/// neighbouring nodes all but coincide.
pub(super) fn check_grid(skin: &SkinFrame, patch: &Patch) -> Result<(), AnatomyError> {
    let grid = patch.chart.grid;
    let spacing = Spacing::of(patch);
    let limit = spacing.mean * LEAST_SPACING;
    if spacing.least < limit {
        let node = spacing.least_at;
        return Err(AnatomyError::TooClose {
            patch: patch.chart.name.clone(),
            u: node % grid.u_count,
            v: node / grid.u_count,
            distance: spacing.least,
            limit,
        });
    }
    let quads = grid.quads().len();
    let standard_count = Resolution::STANDARD.grid(patch.chart.kind).quads().len();
    let mut tolerated = quads.saturating_sub(standard_count) / 100;
    let mut tolerated_on_margin = quads / 100;
    for [u, v] in folded_quads(skin, patch) {
        let left = if v == 0 && tolerated == 0 {
            &mut tolerated_on_margin
        } else {
            &mut tolerated
        };
        if *left == 0 {
            return Err(AnatomyError::Folded {
                patch: patch.chart.name.clone(),
                u,
                v,
            });
        }
        *left -= 1;
    }
    Ok(())
}

/// Quads that face inwards, (u, v) of each.
fn folded_quads(skin: &SkinFrame, patch: &Patch) -> Vec<[u32; 2]> {
    let sign = if patch.chart.side == Side::Right {
        -1.0
    } else {
        1.0
    };
    let is_folded = |quad: &[u32; 4]| {
        let [a, b, c, d] = quad.map(|k| patch.neutral[k as usize]);
        let area = (c - a).cross(&(d - b)) * sign;
        // The two nodes further from the margin: on a margin the skin's normal tells little.
        let outwards: Vector = quad[2..]
            .iter()
            .map(|&k| {
                let node = &patch.chart.nodes[k as usize];
                skin.normal(node.triangle, node.barycentric)
            })
            .sum();
        area.dot(&outwards) < FOLDED * area.norm() * outwards.norm()
    };
    let grid = patch.chart.grid;
    let quads = grid.quads();
    let folded = quads.into_iter().filter(is_folded);
    folded
        .map(|q| [q[0] % grid.u_count, q[0] / grid.u_count])
        .collect()
}

/// Distances between neighbouring nodes of a grid. (mm)
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Least distance.
    pub least: f64,
    /// First node of the pair with the least distance.
    pub least_at: u32,
    /// Mean distance.
    pub mean: f64,
    /// Greatest distance.
    pub greatest: f64,
}

impl Spacing {
    /// Measures a laid patch.
    pub fn of(patch: &Patch) -> Self {
        let grid = patch.chart.grid;
        let mut spacing = Self {
            least: f64::INFINITY,
            least_at: 0,
            mean: 0.0,
            greatest: 0.0,
        };
        let mut count = 0u32;
        let mut add = |a: usize, b: usize| {
            let distance = (patch.neutral[a] - patch.neutral[b]).norm();
            if distance < spacing.least {
                spacing.least = distance;
                spacing.least_at = a as u32;
            }
            spacing.greatest = spacing.greatest.max(distance);
            spacing.mean += distance;
            count += 1;
        };
        for v in 0..grid.v_count {
            for u in 0..grid.u_count {
                if u + 1 < grid.u_count || grid.is_periodic {
                    add(grid.index(u, v), grid.index((u + 1) % grid.u_count, v));
                }
                if v + 1 < grid.v_count {
                    add(grid.index(u, v), grid.index(u, v + 1));
                }
            }
        }
        spacing.mean /= f64::from(count.max(1));
        spacing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::chart::charts;
    use crate::anatomy::lay::lay_patches;
    use crate::template::human;

    #[test]
    fn nothing_of_the_bundled_template_is_folded_even_at_its_margins() {
        let template = human();
        let positions = template.skin.positions();
        let skin = SkinFrame::new(positions, &template.skin.triangles()).expect("skin");
        let charts = charts(template, Resolution::STANDARD).expect("charts");
        let mut patches = lay_patches(template, &charts, positions).expect("patches");
        for patch in &patches {
            assert!(folded_quads(&skin, patch).is_empty());
        }
        // A node pulled over its neighbours folds what is around it.
        let patch = &mut patches[0];
        let grid = patch.chart.grid;
        let [at, beyond] = [grid.index(5, 5), grid.index(9, 5)];
        patch.neutral[at] = patch.neutral[beyond];
        assert!(!folded_quads(&skin, patch).is_empty());
        assert!(check_grid(&skin, patch).is_err());
    }
}
