//! Lids that meet on the template meet on every face.
//!
//! Scaled by one alpha, a blink overshoots on a narrow eye and stays open on a wide one. The
//! pairs of lid vertices that meet on the template are found in its closed pose; on the face,
//! what is left between each pair is shared between both lids in proportion to how much each
//! moves, and fades with the motion of the skin around it.

use crate::template::Template;
use crate::transfer::EyeShapes;
use crate::{Point, Vector};

/// Lid vertices further apart than this in the template's closed pose do not meet. (mm)
const MEETING_DISTANCE: f64 = 2.0;
/// Width of the average over margin vertices that a lid vertex takes its correction from. (mm)
const MARGIN_WIDTH: f64 = 4.0;

/// A margin vertex and what its opposite leaves open.
struct MarginPair {
    upper: usize,
    lower: usize,
}

struct LidPair {
    shape: u32,
    /// On the template.
    deltas: Vec<Vector>,
    pairs: Vec<MarginPair>,
    upper: Vec<bool>,
    lower: Vec<bool>,
}

/// The lids of both eyes on one face.
pub struct LidClosing<'a> {
    template: &'a Template,
    positions: &'a [Point],
    eyes: Vec<LidPair>,
}

impl<'a> LidClosing<'a> {
    /// Finds the pairs that meet; `positions` is the face in the template's topology. (mm)
    pub fn new(template: &'a Template, positions: &'a [Point]) -> Self {
        let eyes = ["l", "r"]
            .into_iter()
            .zip(EyeShapes::of(template))
            .filter_map(|(side, shapes)| {
                let upper = template.regions.find(&format!("upper_lid_{side}"))?;
                let lower = template.regions.find(&format!("lower_lid_{side}"))?;
                let member = |id| -> Vec<bool> {
                    template
                        .regions
                        .vertex_regions
                        .iter()
                        .map(|r| *r == id)
                        .collect()
                };
                let shape = shapes.blink?;
                let (upper, lower) = (member(upper), member(lower));
                let deltas = template.shapes[shape as usize].spread(template.skin.vertex_count());
                let pairs = meeting_pairs(template.skin.positions(), &deltas, &upper, &lower);
                Some(LidPair {
                    shape,
                    deltas,
                    pairs,
                    upper,
                    lower,
                })
            })
            .collect();
        Self {
            template,
            positions,
            eyes,
        }
    }

    /// What to add to the displacements of each blink so that the lids of this face meet.
    ///
    /// - `on_face`: displacement of a template vertex by a shape on this face, amplitude
    ///   included (mm)
    ///
    /// Returns (shape index, one correction per template vertex (mm)).
    pub fn corrections(&self, on_face: impl Fn(u32, usize) -> Vector) -> Vec<(u32, Vec<Vector>)> {
        self.eyes
            .iter()
            .map(|eye| (eye.shape, self.correct(eye, |v| on_face(eye.shape, v))))
            .collect()
    }

    fn correct(&self, eye: &LidPair, on_face: impl Fn(usize) -> Vector) -> Vec<Vector> {
        let rest = self.template.skin.positions();
        let mut upper_marks = Vec::with_capacity(eye.pairs.len());
        let mut lower_marks = Vec::with_capacity(eye.pairs.len());
        for &MarginPair { upper, lower } in &eye.pairs {
            let (du, dl) = (eye.deltas[upper], eye.deltas[lower]);
            let at = self.positions;
            let left_open = (at[upper] + on_face(upper)) - (at[lower] + on_face(lower));
            let gap = left_open - ((rest[upper] + du) - (rest[lower] + dl));
            let share = du.norm() / (du.norm() + dl.norm()).max(f64::EPSILON);
            upper_marks.push((upper, -share * gap));
            lower_marks.push((lower, (1.0 - share) * gap));
        }
        (0..rest.len())
            .map(|v| {
                let amount = eye.deltas[v].norm();
                if amount == 0.0 {
                    return Vector::zeros();
                }
                // Skin around the lids belongs to whichever margin is nearer at rest.
                let uppers = upper_marks.iter().filter(|_| !eye.lower[v]);
                let lowers = lower_marks.iter().filter(|_| !eye.upper[v]);
                let (mut sum, mut total) = (Vector::zeros(), 0.0);
                for &(margin, correction) in uppers.chain(lowers) {
                    let distance = (rest[v] - rest[margin]).norm() / MARGIN_WIDTH;
                    let kernel = (-distance * distance).exp();
                    let ratio = amount / eye.deltas[margin].norm().max(0.1);
                    sum += kernel * ratio.min(1.0) * correction;
                    total += kernel;
                }
                if total > 1e-9 {
                    sum / total
                } else {
                    Vector::zeros()
                }
            })
            .collect()
    }
}

/// For each vertex of either lid that meets the other in the closed pose, the nearest there.
fn meeting_pairs(
    rest: &[Point],
    deltas: &[Vector],
    upper: &[bool],
    lower: &[bool],
) -> Vec<MarginPair> {
    let members = |of: &[bool]| -> Vec<usize> { (0..rest.len()).filter(|&v| of[v]).collect() };
    let (uppers, lowers) = (members(upper), members(lower));
    let closed = |v: usize| rest[v] + deltas[v];
    let nearest = |v: usize, others: &[usize]| {
        others
            .iter()
            .map(|&o| (o, (closed(o) - closed(v)).norm()))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .filter(|(_, distance)| *distance < MEETING_DISTANCE)
    };
    let mut pairs: Vec<MarginPair> = uppers
        .iter()
        .filter_map(|&upper| nearest(upper, &lowers).map(|(lower, _)| MarginPair { upper, lower }))
        .collect();
    pairs.extend(lowers.iter().filter_map(|&lower| {
        nearest(lower, &uppers).map(|(upper, _)| MarginPair { upper, lower })
    }));
    pairs
}
