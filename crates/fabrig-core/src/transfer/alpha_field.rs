//! Alpha of Eq. 3 as a smooth field over the face.
//!
//! Neighbouring patches differ in alpha, so skin between them would be pulled by two
//! amplitudes at once and show the border. Each patch's alpha is laid on the template's skin
//! where its nodes lie; the field is their mean, spread by diffusion, so that all nodes above
//! one another at a place of the skin share one amplitude.

use crate::anatomy::{Patch, SurfaceNode};
use crate::mesh::Topology;
use crate::template::Template;

/// Rounds of diffusion; each spreads by about an edge of the template (3-6 mm on the face).
const ROUNDS: usize = 24;
/// Share of the neighbours' mean taken in each round.
const MIX: f64 = 0.5;
/// Pull of skin that no patch covers towards 1, against one node.
const BACKGROUND: f64 = 1e-3;

/// An amplitude at every vertex of the template's skin.
#[derive(Debug, Clone, PartialEq)]
pub struct AlphaField {
    triangles: Vec<[u32; 3]>,
    by_vertex: Vec<f64>,
}

impl AlphaField {
    /// Spreads the alpha of each patch over the skin around it.
    ///
    /// - `patches`: with the alpha of each; their nodes lie on `template`
    ///
    /// Where all alphas are equal to 1 so is the field, bit for bit.
    pub fn new<'a>(
        template: &Template,
        patches: impl IntoIterator<Item = (&'a Patch, f64)>,
    ) -> Self {
        let triangles = template.skin.triangles();
        let count = template.skin.vertex_count();
        // What a vertex knows (difference from 1) and how firmly.
        let mut known = vec![(0.0, BACKGROUND); count];
        for (patch, alpha) in patches {
            for node in &patch.chart.nodes {
                let corners = triangles[node.triangle as usize];
                for (&v, weight) in corners.iter().zip(node.barycentric) {
                    let entry = &mut known[v as usize];
                    entry.0 += weight * (alpha - 1.0);
                    entry.1 += weight;
                }
            }
        }
        let topology = Topology::from_mesh(&template.skin);
        for _ in 0..ROUNDS {
            known = (0..count)
                .map(|v| {
                    let ring = topology.neighbours(v as u32);
                    let own = known[v];
                    if ring.is_empty() {
                        return own;
                    }
                    let (mut sum, mut total) = (0.0, 0.0);
                    for &n in ring {
                        sum += known[n as usize].0;
                        total += known[n as usize].1;
                    }
                    let share = MIX / ring.len() as f64;
                    (
                        (1.0 - MIX) * own.0 + share * sum,
                        (1.0 - MIX) * own.1 + share * total,
                    )
                })
                .collect();
        }
        Self {
            triangles,
            by_vertex: known.iter().map(|(sum, total)| 1.0 + sum / total).collect(),
        }
    }

    /// The amplitude at each vertex of the template's skin.
    pub fn by_vertex(&self) -> &[f64] {
        &self.by_vertex
    }

    /// The amplitude at a node.
    pub fn at(&self, node: &SurfaceNode) -> f64 {
        self.triangles[node.triangle as usize]
            .iter()
            .zip(node.barycentric)
            .map(|(&v, weight)| (self.by_vertex[v as usize] - 1.0) * weight)
            .sum::<f64>()
            + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{self, Resolution};
    use crate::template::human;

    #[test]
    fn neighbouring_patches_meet_at_one_amplitude() {
        let template = human();
        let charts = anatomy::charts(template, Resolution::default()).unwrap();
        let patches = anatomy::lay_patches(template, &charts, template.skin.positions()).unwrap();
        let even = AlphaField::new(template, patches.iter().map(|p| (p, 1.0)));
        assert!(even.by_vertex().iter().all(|a| *a == 1.0));

        let alphas: Vec<f64> = (0..patches.len())
            .map(|p| 0.9 + 0.2 * (p % 2) as f64)
            .collect();
        let field = AlphaField::new(template, patches.iter().zip(alphas));
        assert!(field.by_vertex().iter().all(|a| (0.9..=1.1).contains(a)));
        let topology = Topology::from_mesh(&template.skin);
        for patch in &patches {
            for node in &patch.chart.nodes {
                let v = field.triangles[node.triangle as usize][0];
                for &n in topology.neighbours(v) {
                    let step = field.by_vertex[v as usize] - field.by_vertex[n as usize];
                    assert!(step.abs() < 0.04, "{} steps by {step}", patch.chart.name);
                }
            }
        }
    }
}
