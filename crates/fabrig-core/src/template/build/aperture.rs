//! How far the lips stand apart along the mouth: closed where a shape means it, open to the
//! corners where the source leaves slits.
//!
//! The opening as seen from the front is measured in columns from the middle of the mouth to
//! its corner, left and right folded together. What is missing to the wanted opening is shared
//! by both lips, and fades with the distance from the line where they meet.

use super::fairing::{distances, smooth_step};
use super::regions::EdgeGraph;
use crate::template::description::ApertureRecipe;
use crate::template::{Landmarks, TemplateError};
use crate::{Point, Vector};

/// Columns between the middle and the corner; the corner itself has no opening.
const COLUMNS: usize = 24;
/// Share of the way to the corner over which corrections fade.
const CORNER: f64 = 0.2;
/// Half the width of a column. (mm)
const HALF_WIDTH: f64 = 0.5;
/// Samples along a side of each triangle.
const FINENESS: u32 = 6;

/// One lip.
struct LipSide {
    /// Triangles that bound the opening.
    triangles: Vec<[u32; 3]>,
    /// Vertices that follow, and how much.
    followers: Vec<(u32, f64)>,
}

/// The opening of the mouth.
pub(super) struct Aperture<'a> {
    recipe: &'a ApertureRecipe,
    rest: &'a [Point],
    corner: u32,
    upper: LipSide,
    lower: LipSide,
    at_rest: [f64; COLUMNS],
}

impl<'a> Aperture<'a> {
    /// - `region_of`: name of the region of each vertex
    pub(super) fn new(
        recipe: &'a ApertureRecipe,
        rest: &'a [Point],
        triangles: &[[u32; 3]],
        graph: &EdgeGraph,
        landmarks: &Landmarks,
        region_of: &dyn Fn(u32) -> &'a str,
    ) -> Result<Self, TemplateError> {
        let at = |name: &str| {
            landmarks
                .get(name)
                .copied()
                .ok_or_else(|| TemplateError::Missing {
                    what: "the opening of the mouth".to_owned(),
                    name: name.to_owned(),
                })
        };
        let (left, right) = (at("lip_corner_l")?, at("lip_corner_r")?);
        let side = |middle: u32, lip: [&str; 2], around: [&str; 2]| {
            let contour: Vec<Point> = [(left, middle), (middle, right)]
                .into_iter()
                .flat_map(|(from, to)| graph.shortest_path(rest, from, to))
                .map(|v| rest[v as usize])
                .collect();
            let near = distances(rest, &contour);
            let is_in = |names: &[&str], v: u32| names.contains(&region_of(v));
            LipSide {
                triangles: triangles
                    .iter()
                    .filter(|t| {
                        t.iter()
                            .all(|&v| is_in(&lip, v) && near[v as usize] < recipe.reach)
                    })
                    .copied()
                    .collect(),
                followers: (0..rest.len() as u32)
                    .filter(|&v| is_in(&lip, v) || is_in(&around, v))
                    .map(|v| (v, smooth_step(1.0 - near[v as usize] / recipe.reach)))
                    .filter(|(_, share)| *share > 0.0)
                    .collect(),
            }
        };
        let mut aperture = Self {
            recipe,
            rest,
            corner: left,
            upper: side(
                at("upper_lip_inner")?,
                ["upper_lip", "mouth_interior_upper"],
                ["upper_lip_skin", "nose"],
            ),
            lower: side(
                at("lower_lip_inner")?,
                ["lower_lip", "mouth_interior_lower"],
                ["jaw", "jaw"],
            ),
            at_rest: [0.0; COLUMNS],
        };
        aperture.at_rest = aperture.openings(&vec![Vector::zeros(); rest.len()]);
        Ok(aperture)
    }

    /// Corrects one symmetric shape.
    pub(super) fn correct(&self, name: &str, deltas: &mut [Vector]) {
        let is_in = |list: &[String]| list.iter().any(|n| n == name);
        let (seals, keeps) = (is_in(&self.recipe.seal), is_in(&self.recipe.keep));
        let opens = self.recipe.open.get(name);
        if !seals && !keeps && opens.is_none() {
            return;
        }
        for _ in 0..self.recipe.rounds {
            let now = self.openings(deltas);
            let mut excess = [0.0; COLUMNS];
            for (c, excess) in excess.iter_mut().enumerate() {
                let f = c as f64 / COLUMNS as f64;
                *excess = match opens {
                    Some(power) => (now[c] - now[0] * (1.0 - f * f).powf(*power)).min(0.0),
                    None if seals => now[c].max(0.0),
                    None => (now[c] - self.at_rest[c].max(0.0)).max(0.0),
                };
                // Around the corner both lips are one: what is left there stays as it is.
                *excess *= smooth_step((1.0 - f) / CORNER);
            }
            self.give(&smoothed(&excess), deltas);
        }
    }

    /// Moves both lips towards each other by the excess of each column.
    fn give(&self, excess: &[f64; COLUMNS], deltas: &mut [Vector]) {
        let corner = self.now(self.corner, deltas).x;
        let at = |x: f64| {
            let place = x.abs() / corner * COLUMNS as f64;
            let (low, t) = (place.floor() as usize, place.fract());
            let column = |c: usize| excess.get(c).copied().unwrap_or(0.0);
            column(low) * (1.0 - t) + column(low + 1) * t
        };
        for (side, sign) in [(&self.upper, -0.5), (&self.lower, 0.5)] {
            for &(vertex, share) in &side.followers {
                let x = self.now(vertex, deltas).x;
                deltas[vertex as usize].y += sign * share * at(x);
            }
        }
    }

    fn now(&self, vertex: u32, deltas: &[Vector]) -> Point {
        self.rest[vertex as usize] + deltas[vertex as usize]
    }

    /// Height between the lips in each column, negative where they overlap as seen from the
    /// front; 0 in a column that shows only one lip. (mm)
    fn openings(&self, deltas: &[Vector]) -> [f64; COLUMNS] {
        let corner = self.now(self.corner, deltas).x;
        let edge = |side: &LipSide, up: f64| {
            let mut edge = [f64::INFINITY; COLUMNS];
            for t in &side.triangles {
                let [a, b, c] = t.map(|v| self.now(v, deltas));
                for i in 0..=FINENESS {
                    for j in 0..=FINENESS - i {
                        let (s, t) = (
                            f64::from(i) / f64::from(FINENESS),
                            f64::from(j) / f64::from(FINENESS),
                        );
                        let p = a + s * (b - a) + t * (c - a);
                        let place = p.x.abs() / corner * COLUMNS as f64;
                        let reach = HALF_WIDTH / corner * COLUMNS as f64;
                        let first = (place - reach).ceil().max(0.0) as usize;
                        let last = (place + reach).floor() as usize;
                        for edge in edge.iter_mut().take(last + 1).skip(first) {
                            *edge = edge.min(up * p.y);
                        }
                    }
                }
            }
            edge
        };
        let (upper, lower) = (edge(&self.upper, 1.0), edge(&self.lower, -1.0));
        std::array::from_fn(|c| {
            let height = upper[c] + lower[c];
            if height.is_finite() { height } else { 0.0 }
        })
    }
}

/// Each column mixed with its neighbours; the middle is its own mirror image, the corner is 0.
fn smoothed(values: &[f64; COLUMNS]) -> [f64; COLUMNS] {
    std::array::from_fn(|c| {
        let before = if c == 0 { values[1] } else { values[c - 1] };
        let after = values.get(c + 1).copied().unwrap_or(0.0);
        0.25 * before + 0.5 * values[c] + 0.25 * after
    })
}
