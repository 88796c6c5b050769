//! Keeps the lids outside the eyeball, and closes them where a shape is named a blink.
//!
//! The source shapes were drawn on another identity: here the lids would sink into the eyeball
//! and miss each other. Both are put right in the shapes, by rule:
//!
//! - *closing*: the three edge rings of the upper lid's margin (front edge, middle, back edge)
//!   are moved onto the same ring of the lower lid, a small gap above it, each vertex to the
//!   place that lies as far along the eye as it does itself;
//! - *smoothing*: between the margins and where the correction ends, the lid's skin is as
//!   smooth as it can be, near to what was drawn;
//! - *clearance*: a lid vertex may not come nearer to the eyeball's centre than the sphere plus
//!   the clearance it has at rest, up to a cap: the lid slides over the sphere.

use std::collections::BTreeMap;

use super::fairing::{Fairing, distances, smooth_step};
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
    /// Rings of the upper margin without the corners.
    upper_margin: Vec<MarginVertex>,
    /// Rings of the lower margin with the corners.
    lower_margin: Vec<MarginVertex>,
    /// Distance from the margin's front edge; infinite where no correction reaches. (mm)
    near: Vec<f64>,
}

/// A vertex of a lid's edge.
#[derive(Debug, Clone, Copy)]
struct MarginVertex {
    vertex: u32,
    ring: u32,
    /// How far along the eye it lies, 0 inner corner to 1 outer corner.
    along: f64,
}

/// How much more the margins count than other skin when lids are smoothed.
const MARGIN_HOLD: f64 = 30.0;
/// The same for margins that are closed.
const CLOSED_HOLD: f64 = 500.0;
/// How much skin counts where the correction ends.
const END_HOLD: f64 = 200.0;
/// How much a closing lid counts as drawn: what closes it was drawn for other eyes.
const CLOSING_SKIN: f64 = 0.3;
/// Rounds of clearance and closing: each moves what the other set.
const ROUNDS: u32 = 3;
/// Share of the eye's length over which the gap of closed lids fades towards the corners.
const GAP_FADE: f64 = 0.12;

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
        let side = |is_upper: bool, chain: &[u32]| -> Vec<MarginVertex> {
            margin
                .iter()
                .filter(|(_, (_, u))| *u == is_upper)
                .map(|(&vertex, &(ring, _))| MarginVertex {
                    vertex,
                    ring,
                    along: along(rest, chain, &rest[vertex as usize]),
                })
                .collect()
        };
        let edge: Vec<Point> = upper
            .iter()
            .chain(&lower)
            .map(|&v| rest[v as usize])
            .collect();
        let mut near = distances(rest, &edge);
        for (near, p) in near.iter_mut().zip(rest) {
            if *near > recipe.reach || p.x <= 0.0 || p.z <= center.z {
                *near = f64::INFINITY;
            }
        }
        Ok(Self {
            recipe,
            rest,
            mirror,
            center,
            radius,
            upper_margin: side(true, &upper),
            lower_margin: side(false, &lower),
            near,
        })
    }

    /// Corrects one shape at both eyes.
    pub(super) fn correct(&self, name: &str, fairing: &Fairing, deltas: &mut [Vector]) {
        let mut mirrored: Vec<Vector> = self
            .mirror
            .iter()
            .map(|&image| reflect(deltas[image as usize]))
            .collect();
        self.correct_left(name, fairing, deltas);
        self.correct_left(name, fairing, &mut mirrored);
        for (vertex, _) in self.reached() {
            deltas[self.mirror[vertex] as usize] = reflect(mirrored[vertex]);
        }
    }

    /// Vertices that corrections reach, and their distance from the edge.
    fn reached(&self) -> impl Iterator<Item = (usize, f64)> {
        let near = self.near.iter().copied().enumerate();
        near.filter(|(_, d)| d.is_finite())
    }

    fn correct_left(&self, name: &str, fairing: &Fairing, deltas: &mut [Vector]) {
        if self.reached().all(|(v, _)| deltas[v] == Vector::zeros()) {
            return;
        }
        let is_closing = self.recipe.closing.iter().any(|n| n == name);
        if let Some(&length) = self.recipe.smoothing.get(name) {
            let drawn = deltas.to_vec();
            for _ in 0..if is_closing { ROUNDS } else { 1 } {
                self.keep_clear(deltas);
                let (given, weights) = self.wanted(is_closing, &drawn, deltas);
                let faired = fairing.solve(&given, &weights, length);
                for (v, _) in self.reached() {
                    deltas[v] = faired[v];
                }
            }
        }
        self.keep_clear(deltas);
    }

    /// What lids are smoothed towards, and how much each vertex counts.
    fn wanted(
        &self,
        is_closing: bool,
        drawn: &[Vector],
        deltas: &[Vector],
    ) -> (Vec<Vector>, Vec<f64>) {
        let mut given = drawn.to_vec();
        let skin = if is_closing { CLOSING_SKIN } else { 1.0 };
        let mut weights = vec![END_HOLD; drawn.len()];
        let fade = self.recipe.reach * 0.4;
        for (v, near) in self.reached() {
            let t = smooth_step((near - fade) / (self.recipe.reach - fade));
            weights[v] = skin + (END_HOLD - skin) * t;
        }
        let mut hold = |m: &MarginVertex, delta: Vector, weight: f64| {
            given[m.vertex as usize] = delta;
            weights[m.vertex as usize] = weight;
        };
        for m in &self.lower_margin {
            hold(m, deltas[m.vertex as usize], MARGIN_HOLD);
        }
        for m in &self.upper_margin {
            let rest = self.rest[m.vertex as usize];
            match self.closed_at(m, deltas) {
                Some(p) if is_closing => hold(m, p - rest, CLOSED_HOLD),
                _ => hold(m, deltas[m.vertex as usize], MARGIN_HOLD),
            }
        }
        (given, weights)
    }

    /// Where a vertex of the upper margin goes when the lids close.
    fn closed_at(&self, m: &MarginVertex, deltas: &[Vector]) -> Option<Point> {
        let mut curve: Vec<(f64, Point)> = self
            .lower_margin
            .iter()
            .filter(|l| l.ring == m.ring)
            .map(|l| {
                let v = l.vertex as usize;
                (l.along, self.rest[v] + deltas[v])
            })
            .collect();
        curve.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (first, last) = (curve.first()?, curve.last()?);
        let s = m.along.clamp(first.0, last.0);
        let on_lower = curve.windows(2).find_map(|pair| {
            let ((a, p), (b, q)) = (pair[0], pair[1]);
            (s <= b).then(|| p + (q - p) * if b > a { (s - a) / (b - a) } else { 0.0 })
        })?;
        let fade = (m.along.min(1.0 - m.along) / GAP_FADE).clamp(0.0, 1.0);
        Some(on_lower + Vector::new(0.0, self.recipe.gap * fade, 0.0))
    }

    /// Pushes lid vertices out of the eyeball.
    fn keep_clear(&self, deltas: &mut [Vector]) {
        for (vertex, _) in self.reached() {
            let rest = self.rest[vertex] - self.center;
            let clearance = (rest.norm() - self.radius).min(self.recipe.clearance);
            let now = rest + deltas[vertex];
            let distance = now.norm();
            let least = self.radius + clearance;
            if distance > 0.0 && distance < least {
                deltas[vertex] += now * (least / distance - 1.0);
            }
        }
    }
}

/// How far along a chain of vertices the point of it nearest to `p` lies, 0 to 1.
fn along(rest: &[Point], chain: &[u32], p: &Point) -> f64 {
    let mut length = 0.0;
    let mut best = (f64::INFINITY, 0.0);
    for pair in chain.windows(2) {
        let (a, b) = (rest[pair[0] as usize], rest[pair[1] as usize]);
        let edge = b - a;
        let t = (edge.dot(&(p - a)) / edge.norm_squared()).clamp(0.0, 1.0);
        let distance = (a + t * edge - p).norm();
        if distance < best.0 {
            best = (distance, length + t * edge.norm());
        }
        length += edge.norm();
    }
    if length > 0.0 { best.1 / length } else { 0.0 }
}
