//! Everything that is put right in a shape, in order.
//!
//! 1. linings: inner skin does not follow outer skin that it does not belong to;
//! 2. fairing: dents and ridges of the drawing are smoothed out, lips are held;
//! 3. bulge: skin that a shape pushes together comes forward;
//! 4. linings: the mouth cavity moves with the flesh around it;
//! 5. lids: smooth, outside the eyeball, closed where a shape is named a blink;
//! 6. opening: lips closed or open along the whole mouth;
//! 7. contact: lips do not pass through each other.
//!
//! Shapes of one side go through this together with their mirror images.

use std::collections::BTreeMap;

use super::aperture::Aperture;
use super::fairing::{Fairing, distances, smooth_step};
use super::lids::Lids;
use super::linings::Linings;
use super::lips::Lips;
use super::sides::Sides;
use crate::mesh::{vertex_areas, vertex_normals};
use crate::template::description::{BuildRecipe, mirrored_name};
use crate::{Point, Vector};

/// The skin at rest and all corrections of its shapes.
pub(super) struct Corrections<'a> {
    pub(super) recipe: &'a BuildRecipe,
    pub(super) rest: &'a [Point],
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) fairing: Fairing,
    pub(super) sides: Sides<'a>,
    pub(super) lids: Lids<'a>,
    pub(super) linings: Linings<'a>,
    pub(super) aperture: Aperture<'a>,
    pub(super) lips: Lips<'a>,
    pub(super) hold: Hold,
}

/// Skin that fairing leaves as drawn, and skin that it fills in.
pub(super) struct Hold {
    /// Distance from the outer lips. (mm)
    from_lips: Vec<f64>,
    is_cavity: Vec<bool>,
    is_outer: Vec<bool>,
}

impl Hold {
    /// - `region_of`: name of the region of each vertex
    pub(super) fn new<'r>(rest: &[Point], region_of: &dyn Fn(u32) -> &'r str) -> Self {
        let of = |test: &dyn Fn(&str) -> bool| -> Vec<bool> {
            (0..rest.len() as u32).map(|v| test(region_of(v))).collect()
        };
        let is_lip = of(&|r| r == "upper_lip" || r == "lower_lip");
        let lips: Vec<Point> = rest
            .iter()
            .zip(&is_lip)
            .filter(|(_, is_lip)| **is_lip)
            .map(|(p, _)| *p)
            .collect();
        let is_inner = |r: &str| {
            ["mouth_interior", "socket", "nostril"]
                .iter()
                .any(|inner| r.starts_with(inner))
        };
        Self {
            from_lips: distances(rest, &lips),
            is_cavity: of(&|r| r.starts_with("mouth_interior")),
            is_outer: of(&|r| !is_inner(r) && r != "upper_lip" && r != "lower_lip"),
        }
    }
}

impl Corrections<'_> {
    /// Corrects one shape; `done` holds those before it.
    pub(super) fn correct(
        &self,
        name: &str,
        drawn: Vec<Vector>,
        done: &BTreeMap<String, Vec<Vector>>,
    ) -> Vec<Vector> {
        let is_of_left = self.sides.is_of_left(&drawn);
        // Jaw and mouth to one side carry both halves: there is nothing to part.
        let is_sideways = !is_of_left && mirrored_name(name).is_some();
        let mut deltas = if is_of_left {
            self.sides.together(&drawn)
        } else {
            drawn
        };
        self.linings.correct(name, &mut deltas);
        self.fair(name, &mut deltas);
        self.bulge(name, &mut deltas);
        self.linings.follow_flesh(name, &mut deltas);
        self.lids.correct(name, &self.fairing, &mut deltas);
        let over = self.recipe.lips.over.get(name).and_then(|n| done.get(n));
        if let Some(over) = over {
            add(&mut deltas, over, 1.0);
        }
        if !is_sideways {
            self.aperture.correct(name, &mut deltas);
        }
        self.lips.separate(&mut deltas);
        if let Some(over) = over {
            add(&mut deltas, over, -1.0);
        }
        if is_sideways {
            return deltas;
        }
        let both = self.sides.symmetric(&deltas);
        if is_of_left {
            self.sides.left_part(&both)
        } else {
            both
        }
    }

    fn fair(&self, name: &str, deltas: &mut Vec<Vector>) {
        let recipe = &self.recipe.fairing;
        let Some(&length) = recipe.lengths.get(name) else {
            return;
        };
        let hold = &self.hold;
        let is_free = recipe.free_lips.iter().any(|n| n == name);
        let lips = if is_free { 1.0 } else { recipe.lips };
        let weights: Vec<f64> = (0..deltas.len())
            .map(|v| {
                let t = 1.0 - hold.from_lips[v] / recipe.lips_reach;
                let base = if hold.is_cavity[v] {
                    recipe.cavity
                } else {
                    1.0
                };
                base + (lips - base) * smooth_step(t)
            })
            .collect();
        *deltas = self.fairing.solve(deltas, &weights, length);
    }

    fn bulge(&self, name: &str, deltas: &mut [Vector]) {
        let Some(&height) = self.recipe.fairing.bulge.get(name) else {
            return;
        };
        let now: Vec<Point> = self.rest.iter().zip(&*deltas).map(|(p, d)| p + d).collect();
        let normals = vertex_normals(&now, self.triangles);
        let before = vertex_areas(self.rest, self.triangles);
        let after = vertex_areas(&now, self.triangles);
        let pushed: Vec<Vector> = (0..now.len())
            .map(|v| {
                let lost = if self.hold.is_outer[v] && before[v] > 0.0 {
                    (1.0 - after[v] / before[v]).max(0.0)
                } else {
                    0.0
                };
                normals[v] * (lost * height)
            })
            .collect();
        let weights: Vec<f64> = (0..now.len())
            .map(|v| if self.hold.is_outer[v] { 1.0 } else { 100.0 })
            .collect();
        let bulge = self
            .fairing
            .solve(&pushed, &weights, self.recipe.fairing.bulge_length);
        add(deltas, &bulge, 1.0);
    }
}

fn add(deltas: &mut [Vector], other: &[Vector], sign: f64) {
    for (delta, other) in deltas.iter_mut().zip(other) {
        *delta += sign * other;
    }
}
