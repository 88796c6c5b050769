//! Keeps the lips from passing through each other in the shapes.
//!
//! The source shapes were drawn on an identity whose lips stand open at rest; here the lips
//! touch, and a pucker or a press would push one through the other. Where a sample of one lip
//! lies beyond the other's surface, both give way by half along the normal of that surface, and
//! their surroundings with them, in rounds until nothing crosses.

use crate::template::description::LipRecipe;
use crate::{Point, Vector};

/// A point of a lip as a mean of three, two or one vertices; unused places hold `NONE`.
type Sample = [u32; 3];
const NONE: u32 = u32::MAX;

/// One lip: what can touch and what moves with it.
struct Lip {
    /// Vertices, middles of edges and of triangles of lip and lining.
    samples: Vec<Sample>,
    /// Triangles of lip and lining.
    triangles: Vec<[u32; 3]>,
    /// Vertices that follow, and how: (vertex, [(index into `samples`, weight)]).
    followers: Vec<(u32, Vec<(usize, f64)>)>,
}

/// Both lips at rest.
pub(super) struct Lips<'a> {
    recipe: &'a LipRecipe,
    rest: &'a [Point],
    upper: Lip,
    lower: Lip,
}

/// Which vertices belong to what, by name of their region.
pub(super) struct LipVertices<'a> {
    pub(super) region_of: &'a dyn Fn(u32) -> &'a str,
    /// Linings are followed back to this z. (mm)
    pub(super) back: f64,
}

/// A triangle of the other lip, posed.
struct Face {
    corners: [Point; 3],
    normal: Vector,
    low: [f64; 2],
    high: [f64; 2],
}

impl<'a> Lips<'a> {
    pub(super) fn new(
        recipe: &'a LipRecipe,
        rest: &'a [Point],
        triangles: &[[u32; 3]],
        labels: &LipVertices<'_>,
    ) -> Self {
        let lip = |touching: [&str; 2], following: &[&str]| {
            let is_in = |names: &[&str], v: u32| names.contains(&(labels.region_of)(v));
            let touches = |v: u32| rest[v as usize].z > labels.back && is_in(&touching, v);
            let triangles: Vec<[u32; 3]> = triangles
                .iter()
                .filter(|t| t.iter().all(|&v| touches(v)))
                .copied()
                .collect();
            let samples = samples(&triangles);
            let places: Vec<Point> = samples
                .iter()
                .map(|s| place(s, &|v| rest[v as usize]))
                .collect();
            let followers = (0..rest.len() as u32)
                .filter(|&v| is_in(&touching, v) || is_in(following, v))
                .filter_map(|v| Some((v, nearness(&places, &rest[v as usize], recipe.blur)?)))
                .collect();
            Lip {
                samples,
                triangles,
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
        }
    }

    /// Corrects one shape.
    pub(super) fn separate(&self, deltas: &mut [Vector]) {
        for _ in 0..self.recipe.rounds {
            let now = |v: u32| self.rest[v as usize] + deltas[v as usize];
            let up = self.ways_out(&self.upper, &self.lower, 1.0, &now);
            let down = self.ways_out(&self.lower, &self.upper, -1.0, &now);
            let most = up.iter().chain(&down).map(Vector::norm).fold(0.0, f64::max);
            if most < self.recipe.tolerance {
                return;
            }
            for (lip, ways) in [(&self.upper, up), (&self.lower, down)] {
                for (vertex, near) in &lip.followers {
                    let give: Vector = near.iter().map(|&(i, w)| w * ways[i]).sum();
                    deltas[*vertex as usize] += give / 2.0;
                }
            }
        }
    }

    /// The shortest way out of the other lip for each sample of `lip`, nothing where it is
    /// outside; `up` is 1 for the lip whose way out is up. (mm)
    fn ways_out(&self, lip: &Lip, other: &Lip, up: f64, now: &dyn Fn(u32) -> Point) -> Vec<Vector> {
        let faces: Vec<Face> = other
            .triangles
            .iter()
            .filter_map(|t| Face::new(t.map(now), up))
            .collect();
        lip.samples
            .iter()
            .map(|sample| {
                let p = place(sample, now);
                let depths = faces.iter().filter_map(|face| {
                    let depth = (face.height(p.x, p.z)? - p.y) * up;
                    (depth > 0.0 && depth < self.recipe.deepest).then_some((depth, face))
                });
                let deepest = depths.max_by(|a, b| a.0.total_cmp(&b.0));
                // Along the normal the surface is nearer than straight up or down.
                deepest.map_or_else(Vector::zeros, |(depth, face)| {
                    face.normal * (depth * face.normal.y.abs())
                })
            })
            .collect()
    }
}

impl Face {
    /// `None` for a triangle that does not look `up` (1 or -1).
    fn new(corners: [Point; 3], up: f64) -> Option<Self> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        (normal.y * up > 0.0).then(|| Self {
            corners,
            normal,
            low: [a.x.min(b.x).min(c.x), a.z.min(b.z).min(c.z)],
            high: [a.x.max(b.x).max(c.x), a.z.max(b.z).max(c.z)],
        })
    }

    /// Height over (x, z).
    fn height(&self, x: f64, z: f64) -> Option<f64> {
        if x < self.low[0] || x > self.high[0] || z < self.low[1] || z > self.high[1] {
            return None;
        }
        let [a, b, c] = &self.corners;
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
}

/// Corners, middles of edges and middles of triangles, each once.
fn samples(triangles: &[[u32; 3]]) -> Vec<Sample> {
    let mut samples: Vec<Sample> = Vec::new();
    for &[a, b, c] in triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            samples.push([a, NONE, NONE]);
            samples.push([a.min(b), a.max(b), NONE]);
        }
        samples.push([a, b, c]);
    }
    samples.sort_unstable();
    samples.dedup();
    samples
}

fn place(sample: &Sample, now: &dyn Fn(u32) -> Point) -> Point {
    let used = sample.iter().filter(|&&v| v != NONE);
    let count = used.clone().count() as f64;
    let sum: Vector = used.map(|&v| now(v).coords).sum();
    Point::from(sum / count)
}

fn nearness(places: &[Point], p: &Point, blur: f64) -> Option<Vec<(usize, f64)>> {
    let weights: Vec<(usize, f64)> = places
        .iter()
        .enumerate()
        .map(|(i, q)| (i, (q - p).norm() / blur))
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
