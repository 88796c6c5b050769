//! Narrow rows: skin that hangs on the one patch right under it.
//!
//! Fitted rows spread over several patches and many nodes, and a wrinkle of wavelength L that is
//! averaged by a kernel of width s keeps only `exp(-2 pi^2 s^2 / L^2)` of its depth. Where
//! wrinkles live, the kernel has to shrink: there a vertex takes the nodes of the grid cell under
//! it alone, by Catmull-Rom interpolation, which meets the nodes exactly. As muscle shapes are
//! sampled from the motion of the skin above each node, such a row also follows them.
//!
//! From wide to narrow rows the way is smooth: `row = (1 - m) wide + m narrow`, where m is the
//! value of the map and falls to zero over [`FADE`] outside the patches. Where several patches
//! lie under a vertex, the nearest to the skin counts most.

use crate::anatomy::{GridShape, Patch};
use crate::mesh::{Surface, SurfaceError};
use crate::skin::{SkinBinding, SkinError, kernel};
use crate::{Point, Vector};

/// How far outside the patches narrow rows still count, along the skin. (mm)
const FADE: f64 = 6.0;
/// Skin further above a patch than this is other skin. (mm)
const HIGHEST: f64 = 9.0;
/// Skin that faces away from the patch by more than this is other skin (cosine).
const LEAST_COSINE: f64 = 0.4;

/// A patch that skin may hang on by narrow rows.
pub struct NarrowPatch<'a> {
    /// As it lies under the face. (mm)
    patch: &'a Patch,
    /// Index of its first node among all nodes.
    start: u32,
    surface: Surface,
    normals: Vec<Vector>,
    /// Grid cell of each triangle, and whether it is the cell's second.
    cells: Vec<([u32; 2], bool)>,
}

/// Where a vertex lies over a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footing {
    /// Grid coordinates.
    pub uv: [f64; 2],
    /// How much the patch counts, 0 to 1.
    pub share: f64,
    /// How far the point is above the patch, against the most that it may be; negative below.
    pub height: f64,
}

impl<'a> NarrowPatch<'a> {
    /// - `start`: index of the patch's first node among all nodes
    ///
    /// # Errors
    ///
    /// [`SurfaceError`] for a patch that is no surface.
    pub fn new(patch: &'a Patch, start: u32) -> Result<Self, SurfaceError> {
        let grid = patch.chart.grid;
        let is_mirrored = patch.chart.quads().first() != grid.quads().first();
        let mut triangles = Vec::new();
        let mut cells = Vec::new();
        for [a, b, c, d] in grid.quads() {
            let cell = [a % grid.u_count, a / grid.u_count];
            triangles.extend([[a, b, c], [a, c, d]]);
            cells.extend([(cell, false), (cell, true)]);
        }
        let mut normals = crate::mesh::vertex_normals(&patch.neutral, &triangles);
        if is_mirrored {
            normals.iter_mut().for_each(|n| *n = -*n);
        }
        Ok(Self {
            patch,
            start,
            surface: Surface::new(&patch.neutral, &triangles)?,
            normals,
            cells,
        })
    }

    /// Outward normals of the nodes.
    pub fn normals(&self) -> &[Vector] {
        &self.normals
    }

    /// The place of the grid under a point of the skin; none where this skin is not above it.
    ///
    /// - `normal`: of the skin there
    pub fn under(&self, point: &Point, normal: &Vector) -> Option<Footing> {
        let place = self.surface.closest(point);
        let ([u, v], is_second) = self.cells[place.triangle as usize];
        let [_, second, third] = place.barycentric;
        // Corners (0,0), (1,0), (1,1) or (0,0), (1,1), (0,1).
        let (du, dv) = if is_second {
            (second, second + third)
        } else {
            (second + third, third)
        };
        let up = self.surface.blend(&place, &self.normals);
        let up = up.try_normalize(f64::EPSILON)?;
        let away = point - place.point;
        let height = away.dot(&up);
        let outside = (away - up * height).norm();
        let is_above = height.abs() < HIGHEST && up.dot(normal) > LEAST_COSINE;
        let near = kernel::falloff(outside, FADE) * kernel::falloff(height, HIGHEST);
        (is_above && near > 0.0).then_some(Footing {
            uv: [f64::from(u) + du, f64::from(v) + dv],
            share: near,
            height: height / HIGHEST,
        })
    }

    /// Nodes (among all) and their shares at a place of the grid; shares sum to one.
    pub fn nodes(&self, uv: [f64; 2]) -> Vec<(u32, f64)> {
        let grid = self.patch.chart.grid;
        catmull_rom(grid, uv)
            .into_iter()
            .map(|(node, share)| (self.start + node, share))
            .collect()
    }

    /// The value of something that stands at the patch's nodes.
    pub fn at(&self, uv: [f64; 2], values: &[f64]) -> f64 {
        let nodes = catmull_rom(self.patch.chart.grid, uv);
        nodes
            .iter()
            .map(|&(n, share)| values[n as usize] * share)
            .sum()
    }
}

/// Shares of the 4 x 4 nodes around a place of a grid, by node.
fn catmull_rom(grid: GridShape, [u, v]: [f64; 2]) -> Vec<(u32, f64)> {
    let along = |x: f64, count: u32, is_periodic: bool| -> [(u32, f64); 4] {
        let last = i64::from(count) - 1;
        let cell = (x.floor() as i64).clamp(0, if is_periodic { last } else { (last - 1).max(0) });
        let t = x - cell as f64;
        let shares = [
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (-2.5 + 1.5 * t),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t),
        ];
        std::array::from_fn(|k| {
            let place = cell + k as i64 - 1;
            let place = if is_periodic {
                place.rem_euclid(i64::from(count))
            } else {
                place.clamp(0, last)
            };
            (place as u32, shares[k])
        })
    };
    let us = along(u, grid.u_count, grid.is_periodic);
    let vs = along(v, grid.v_count, false);
    let mut shares: Vec<(u32, f64)> = Vec::with_capacity(16);
    for (v, sv) in vs {
        for (u, su) in us {
            let node = grid.index(u, v) as u32;
            match shares.iter_mut().find(|(n, _)| *n == node) {
                Some(entry) => entry.1 += su * sv,
                None => shares.push((node, su * sv)),
            }
        }
    }
    shares
}

impl SkinBinding {
    /// The same binding, in which skin over some patches hangs on them by narrow rows.
    ///
    /// - `skin`, `normals`: of every vertex at rest [mm, head frame]
    /// - `value`: of the map for a vertex and patch (index among `patches`), 0 to 1
    ///
    /// # Errors
    ///
    /// [`SkinError::VertexCount`] where the skin does not fit.
    pub fn narrowed(
        &self,
        patches: &[NarrowPatch<'_>],
        skin: &[Point],
        normals: &[Vector],
        value: &dyn Fn(usize, usize, [f64; 2]) -> f64,
    ) -> Result<Self, SkinError> {
        if skin.len() != self.vertex_count() || normals.len() != skin.len() {
            return Err(SkinError::VertexCount {
                expected: self.vertex_count(),
                found: skin.len().min(normals.len()),
            });
        }
        let mut starts = vec![0];
        let mut nodes = Vec::with_capacity(self.nodes.len());
        let mut weights = Vec::with_capacity(self.weights.len());
        for (vertex, (point, normal)) in skin.iter().zip(normals).enumerate() {
            // Vertices without a row are rigid.
            let is_bound = self.row(vertex).next().is_some();
            let mut row: Vec<(u32, f64)> = Vec::new();
            let (mut total, mut most) = (0.0, 0.0f64);
            for (p, patch) in patches.iter().enumerate().filter(|_| is_bound) {
                let Some(footing) = patch.under(point, normal) else {
                    continue;
                };
                let share = footing.share * value(vertex, p, footing.uv).clamp(0.0, 1.0);
                if share > 0.0 {
                    let own = patch.nodes(footing.uv);
                    row.extend(own.iter().map(|&(node, s)| (node, share * s)));
                    total += share;
                    most = most.max(share);
                }
            }
            // Full where a patch counts more than half of what it could right on it.
            let part = smooth_step(2.0 * most.min(0.5));
            let wide = self
                .row(vertex)
                .map(|(n, w)| (n, (1.0 - part) * f64::from(w)));
            if total > 0.0 {
                row.iter_mut().for_each(|entry| entry.1 *= part / total);
            }
            row.extend(wide);
            row.sort_by_key(|entry| entry.0);
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                let weight: f64 = same.iter().map(|entry| entry.1).sum();
                if weight.abs() > 1e-5 {
                    nodes.push(same[0].0);
                    weights.push(weight as f32);
                }
            }
            starts.push(nodes.len() as u32);
        }
        Ok(Self {
            node_counts: self.node_counts.clone(),
            starts,
            nodes,
            weights,
        })
    }
}

fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
