//! Keeps the lids outside the eyeball, and closes them where a shape is named a blink.
//!
//! The source shapes were drawn on another identity: here the lids would sink into the eyeball
//! and miss each other. Both are put right in the shapes, by rule:
//!
//! - *closing*: the three edge rings of the upper lid's margin (front edge, middle, back edge)
//!   are moved onto the same ring of the lower lid, a small gap above it; the correction fades
//!   out over a reach along the lid, so that crease and brow stay as drawn.
//! - *clearance*: a lid vertex may not come nearer to the eyeball's centre than the sphere plus
//!   the clearance it has at rest, up to a cap: the lid slides over the sphere.

use std::collections::BTreeMap;

use super::identity::reflect;
use super::regions::EdgeGraph;
use crate::template::description::LidRecipe;
use crate::template::{Landmarks, TemplateError};
use crate::{Point, Vector};

/// Landmarks of the margin's front edge from the inner corner over the upper lid.
const UPPER: [&str; 5] = [
    "eye_inner_l",
    "upper_lid_inner_l",
    "upper_lid_mid_l",
    "upper_lid_outer_l",
    "eye_outer_l",
];
/// The same under the eye.
const LOWER: [&str; 5] = [
    "eye_inner_l",
    "lower_lid_inner_l",
    "lower_lid_mid_l",
    "lower_lid_outer_l",
    "eye_outer_l",
];
/// Rings of the margin, front edge to back edge.
const RING_COUNT: u32 = 3;

/// The left eye's lids at rest.
pub(super) struct Lids<'a> {
    recipe: &'a LidRecipe,
    rest: &'a [Point],
    mirror: &'a [u32],
    center: Point,
    radius: f64,
    /// Rings of the upper margin without the corners: (vertex, ring).
    upper_margin: Vec<(u32, u32)>,
    /// Rings of the lower margin with the corners: (vertex, ring).
    lower_margin: Vec<(u32, u32)>,
    /// Vertices within reach of the margin: (vertex, whether it goes with the upper lid,
    /// how much of the margin's correction it takes).
    around: Vec<(u32, bool, f64)>,
}

impl<'a> Lids<'a> {
    pub(super) fn new(
        recipe: &'a LidRecipe,
        rest: &'a [Point],
        mirror: &'a [u32],
        graph: &EdgeGraph,
        landmarks: &Landmarks,
        (center, radius): (Point, f64),
    ) -> Result<Self, TemplateError> {
        let chain = |names: &[&str]| -> Result<Vec<u32>, TemplateError> {
            let corners = names
                .iter()
                .map(|name| {
                    landmarks
                        .get(*name)
                        .copied()
                        .ok_or_else(|| TemplateError::Missing {
                            what: "the lids".to_owned(),
                            name: (*name).to_owned(),
                        })
                })
                .collect::<Result<Vec<_>, _>>()?;
            let mut chain = vec![corners[0]];
            for pair in corners.windows(2) {
                let mut path = graph.shortest_path(rest, pair[0], pair[1]);
                path.reverse();
                chain.extend_from_slice(&path[1..]);
            }
            Ok(chain)
        };
        let (upper, lower) = (chain(&UPPER)?, chain(&LOWER)?);
        // Ring and side of every margin vertex; corners count as lower lid.
        let mut margin: BTreeMap<u32, (u32, bool)> = BTreeMap::new();
        margin.extend(upper.iter().map(|&v| (v, (0, true))));
        margin.extend(lower.iter().map(|&v| (v, (0, false))));
        for ring in 1..RING_COUNT {
            let last: Vec<(u32, bool)> = margin
                .iter()
                .filter(|(_, (r, _))| *r == ring - 1)
                .map(|(&v, &(_, is_upper))| (v, is_upper))
                .collect();
            for (vertex, is_upper) in last {
                for &next in graph.neighbours(vertex) {
                    // Inwards is towards the eyeball's centre.
                    let is_inner = (rest[next as usize] - center).norm() + recipe.ring_step
                        < (rest[vertex as usize] - center).norm();
                    if is_inner {
                        margin.entry(next).or_insert((ring, is_upper));
                    }
                }
            }
        }
        let side = |is_upper: bool| -> Vec<(u32, u32)> {
            margin
                .iter()
                .filter(|(_, (_, u))| *u == is_upper)
                .map(|(&v, &(ring, _))| (v, ring))
                .collect()
        };
        let around = around(recipe, rest, &upper, &lower, &margin);
        Ok(Self {
            recipe,
            rest,
            mirror,
            center,
            radius,
            upper_margin: side(true),
            lower_margin: side(false),
            around,
        })
    }

    /// Corrects one shape at both eyes.
    pub(super) fn correct(&self, name: &str, deltas: &mut [Vector]) {
        self.correct_left(self.recipe.closing.iter().any(|n| n == name), deltas);
        let mut mirrored: Vec<Vector> = self
            .mirror
            .iter()
            .map(|&image| reflect(deltas[image as usize]))
            .collect();
        self.correct_left(false, &mut mirrored);
        for &(vertex, _, _) in &self.around {
            deltas[self.mirror[vertex as usize] as usize] = reflect(mirrored[vertex as usize]);
        }
    }

    fn correct_left(&self, is_closing: bool, deltas: &mut [Vector]) {
        if self
            .around
            .iter()
            .all(|&(v, _, _)| deltas[v as usize] == Vector::zeros())
        {
            return;
        }
        if is_closing {
            // Clearance moves vertices along the sphere's radius and so changes where the
            // margins are seen to meet: a few rounds settle both.
            for _ in 0..4 {
                self.keep_clear(deltas);
                self.close(deltas);
            }
        }
        self.keep_clear(deltas);
    }

    /// Moves the upper margin onto the lower one.
    fn close(&self, deltas: &mut [Vector]) {
        let now = |v: u32, deltas: &[Vector]| self.rest[v as usize] + deltas[v as usize];
        let mut corrections: Vec<(u32, Vector)> = Vec::new();
        for ring in 0..RING_COUNT {
            let mut curve: Vec<Point> = self
                .lower_margin
                .iter()
                .filter(|(_, r)| *r == ring)
                .map(|&(v, _)| now(v, deltas))
                .collect();
            curve.sort_by(|a, b| a.x.total_cmp(&b.x));
            for &(vertex, _) in self.upper_margin.iter().filter(|(_, r)| *r == ring) {
                let p = now(vertex, deltas);
                if let Some(on_lower) = at_x(&curve, p.x) {
                    let target = on_lower + Vector::new(0.0, self.recipe.gap, 0.0);
                    corrections.push((vertex, target - p));
                }
            }
        }
        let front: Vec<(Point, Vector)> = corrections
            .iter()
            .map(|&(v, c)| (self.rest[v as usize], c))
            .collect();
        let exact: BTreeMap<u32, Vector> = corrections.into_iter().collect();
        for &(vertex, is_upper, share) in self.around.iter().filter(|(_, u, _)| *u) {
            debug_assert!(is_upper);
            let correction = exact.get(&vertex).copied().unwrap_or_else(|| {
                share * nearby_mean(&front, &self.rest[vertex as usize], self.recipe.blur)
            });
            deltas[vertex as usize] += correction;
        }
    }

    /// Pushes lid vertices out of the eyeball.
    fn keep_clear(&self, deltas: &mut [Vector]) {
        for &(vertex, _, _) in &self.around {
            let rest = self.rest[vertex as usize] - self.center;
            let clearance = (rest.norm() - self.radius).min(self.recipe.clearance);
            let now = rest + deltas[vertex as usize];
            let distance = now.norm();
            let least = self.radius + clearance;
            if distance > 0.0 && distance < least && rest.z > 0.0 {
                deltas[vertex as usize] += now * (least / distance - 1.0);
            }
        }
    }
}

fn around(
    recipe: &LidRecipe,
    rest: &[Point],
    upper: &[u32],
    lower: &[u32],
    margin: &BTreeMap<u32, (u32, bool)>,
) -> Vec<(u32, bool, f64)> {
    let distance_to = |chain: &[u32], p: &Point| {
        chain
            .iter()
            .map(|&v| (rest[v as usize] - p).norm())
            .fold(f64::INFINITY, f64::min)
    };
    (0u32..)
        .zip(rest)
        .filter_map(|(vertex, p)| {
            let (to_upper, to_lower) = (distance_to(upper, p), distance_to(lower, p));
            let nearest = to_upper.min(to_lower);
            if nearest > recipe.reach {
                return None;
            }
            let is_upper = match margin.get(&vertex) {
                Some(&(_, is_upper)) => is_upper,
                None => to_upper < to_lower,
            };
            // Fades to nothing at the reach with no slope at either end, and towards the
            // corners where the other lid is as near.
            let t = 1.0 - nearest / recipe.reach;
            let fade = t * t * (3.0 - 2.0 * t);
            Some((vertex, is_upper, fade))
        })
        .collect()
}

/// Mean of values weighted by nearness to `p`.
fn nearby_mean(values: &[(Point, Vector)], p: &Point, blur: f64) -> Vector {
    let mut sum = Vector::zeros();
    let mut total = 0.0;
    let nearest = values
        .iter()
        .map(|(q, _)| (q - p).norm_squared())
        .fold(f64::INFINITY, f64::min);
    for (q, value) in values {
        let weight = (-((q - p).norm_squared() - nearest) / (2.0 * blur * blur)).exp();
        sum += weight * value;
        total += weight;
    }
    if total > 0.0 { sum / total } else { sum }
}

/// The point of a curve sorted by x at one x; `None` outside its ends.
fn at_x(curve: &[Point], x: f64) -> Option<Point> {
    curve.windows(2).find_map(|pair| {
        let (a, b) = (pair[0], pair[1]);
        if x < a.x || x > b.x || a.x == b.x {
            return None;
        }
        Some(a + (b - a) * ((x - a.x) / (b.x - a.x)))
    })
}
