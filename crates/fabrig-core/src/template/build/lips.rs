//! Keeps the lips from passing through each other in the shapes.
//!
//! The source shapes were drawn on an identity whose lips stand open at rest; here the lips
//! touch, and a pucker or a press would push one through the other. Where the underside of the
//! upper lip comes to lie below the top of the lower lip (at the same x and z), both give way
//! by half, and their surroundings with them, in rounds until nothing crosses.
//!
//! A shape of one side is put right as it acts together with its mirror image, each side
//! taking its own half of the correction, and then once more alone.

use super::identity::reflect;
use crate::template::description::LipRecipe;
use crate::{Point, Vector};

/// One lip: what can touch and what moves with it.
struct Lip {
    /// Vertices of lip and lining.
    vertices: Vec<u32>,
    /// Triangles of lip and lining.
    triangles: Vec<[u32; 3]>,
    /// Vertices that follow, and how: (vertex, [(index into `vertices`, weight)]), weights
    /// sum to 1.
    followers: Vec<(u32, Vec<(usize, f64)>)>,
}

/// Both lips at rest.
pub(super) struct Lips<'a> {
    recipe: &'a LipRecipe,
    rest: &'a [Point],
    mirror: &'a [u32],
    upper: Lip,
    lower: Lip,
}

/// Which vertices belong to what, by name of their region.
pub(super) struct LipVertices<'a> {
    pub(super) region_of: &'a dyn Fn(u32) -> &'a str,
    /// Linings are followed back to this z. (mm)
    pub(super) back: f64,
}

impl<'a> Lips<'a> {
    pub(super) fn new(
        recipe: &'a LipRecipe,
        rest: &'a [Point],
        mirror: &'a [u32],
        triangles: &[[u32; 3]],
        labels: &LipVertices<'_>,
    ) -> Self {
        let lip = |touching: [&str; 2], following: &[&str]| {
            let is_in = |names: &[&str], v: u32| names.contains(&(labels.region_of)(v));
            let touches = |v: u32| rest[v as usize].z > labels.back && is_in(&touching, v);
            let all = 0..rest.len() as u32;
            let vertices: Vec<u32> = all.clone().filter(|&v| touches(v)).collect();
            let followers = all
                .filter(|&v| is_in(&touching, v) || is_in(following, v))
                .filter_map(|v| Some((v, nearness(rest, &vertices, v, recipe.blur)?)))
                .collect();
            Lip {
                triangles: triangles
                    .iter()
                    .filter(|t| t.iter().all(|&v| touches(v)))
                    .copied()
                    .collect(),
                vertices,
                followers,
            }
        };
        Self {
            upper: lip(
                ["upper_lip", "mouth_interior_upper"],
                &["upper_lip_skin", "nose"],
            ),
            lower: lip(["lower_lip", "mouth_interior_lower"], &["jaw"]),
            recipe,
            rest,
            mirror,
        }
    }

    /// Corrects one shape; `over` is what it is always seen with.
    pub(super) fn correct(&self, deltas: &mut [Vector], over: Option<&[Vector]>) {
        if self.is_of_left_side(deltas) {
            let before: Vec<Vector> = (0..deltas.len())
                .map(|v| deltas[v] + reflect(deltas[self.mirror[v] as usize]))
                .collect();
            let mut both = before.clone();
            self.separate(&mut both);
            for (v, delta) in deltas.iter_mut().enumerate() {
                let t = (self.rest[v].x / self.recipe.side_blend + 1.0) / 2.0;
                *delta += t.clamp(0.0, 1.0) * (both[v] - before[v]);
            }
        }
        match over {
            None => self.separate(deltas),
            Some(over) => {
                let mut sum: Vec<Vector> = deltas.iter().zip(over).map(|(a, b)| a + b).collect();
                self.separate(&mut sum);
                for ((delta, sum), over) in deltas.iter_mut().zip(sum).zip(over) {
                    *delta = sum - over;
                }
            }
        }
    }

    /// Whether nearly all that moves lies on the left (the sides of `mouthLeft`, which carries
    /// the whole mouth, do not).
    fn is_of_left_side(&self, deltas: &[Vector]) -> bool {
        let (mut left, mut right) = (0.0, 0.0);
        for (p, delta) in self.rest.iter().zip(deltas) {
            if p.x > 0.0 {
                left += delta.norm_squared();
            } else if p.x < 0.0 {
                right += delta.norm_squared();
            }
        }
        left > 4.0 * right
    }

    fn separate(&self, deltas: &mut [Vector]) {
        for _ in 0..self.recipe.rounds {
            let now = |v: u32| self.rest[v as usize] + deltas[v as usize];
            let up = self.crossing(&self.upper, &self.lower, 1.0, &now);
            let down = self.crossing(&self.lower, &self.upper, -1.0, &now);
            let most = up.iter().chain(&down).copied().fold(0.0, f64::max);
            if most < self.recipe.tolerance {
                return;
            }
            for (lip, depths, sign) in [(&self.upper, up, 1.0), (&self.lower, down, -1.0)] {
                for (vertex, near) in &lip.followers {
                    let give: f64 = near.iter().map(|&(i, w)| w * depths[i]).sum();
                    deltas[*vertex as usize].y += sign * give / 2.0;
                }
            }
        }
    }

    /// How far each vertex of `lip` is beyond the other lip's surface; `up` is 1 for the lip
    /// whose way out is up.
    fn crossing(&self, lip: &Lip, other: &Lip, up: f64, now: &dyn Fn(u32) -> Point) -> Vec<f64> {
        let surface: Vec<[Point; 3]> = other
            .triangles
            .iter()
            .map(|t| t.map(now))
            .filter(|[a, b, c]| (b - a).cross(&(c - a)).y * up > 0.0)
            .collect();
        lip.vertices
            .iter()
            .map(|&v| {
                let p = now(v);
                surface
                    .iter()
                    .filter_map(|triangle| height_at(triangle, p.x, p.z))
                    .map(|y| (y - p.y) * up)
                    .filter(|&depth| depth > 0.0 && depth < self.recipe.deepest)
                    .fold(0.0, f64::max)
            })
            .collect()
    }
}

fn nearness(rest: &[Point], vertices: &[u32], vertex: u32, blur: f64) -> Option<Vec<(usize, f64)>> {
    let p = rest[vertex as usize];
    let weights: Vec<(usize, f64)> = vertices
        .iter()
        .enumerate()
        .map(|(i, &v)| (i, (rest[v as usize] - p).norm() / blur))
        .filter(|(_, d)| *d < 3.0)
        .map(|(i, d)| (i, (-d * d / 2.0).exp()))
        .collect();
    let total: f64 = weights.iter().map(|(_, w)| w).sum();
    let strongest = weights.iter().map(|(_, w)| *w).fold(0.0, f64::max);
    // Far from the lips the sum fades instead of being made whole.
    (total > 0.0).then(|| {
        weights
            .into_iter()
            .map(|(i, w)| (i, w * strongest / total))
            .collect()
    })
}

/// Height of a triangle over (x, z).
fn height_at([a, b, c]: &[Point; 3], x: f64, z: f64) -> Option<f64> {
    let (ux, uz) = (b.x - a.x, b.z - a.z);
    let (vx, vz) = (c.x - a.x, c.z - a.z);
    let area = ux * vz - uz * vx;
    if area == 0.0 {
        return None;
    }
    let (px, pz) = (x - a.x, z - a.z);
    let s = (px * vz - pz * vx) / area;
    let t = (ux * pz - uz * px) / area;
    let is_inside = s >= 0.0 && t >= 0.0 && s + t <= 1.0;
    is_inside.then(|| a.y + s * (b.y - a.y) + t * (c.y - a.y))
}
