//! Stretch and compression along grid edges.
//!
//! `C = |x_i - x_j| - l`, with one compliance where the edge is longer than `l` and another
//! where it is shorter. The rest length moves with the target:
//! `l(t) = l_0 + b_e (|X_i - X_j|(t) - l_0)`, where `l_0` is the neutral length and `b_e` is
//! [`rest_blend`](crate::cloth::ClothOptions::rest_blend), varied a little from edge to edge
//! (the rest imperfection). With `b = 0` a contracted muscle keeps its neutral length and
//! wrinkles (the paper); with `b = 1` its target shape is free of stress. Within a frame the
//! rest length goes straight from that of the frame's start to that of its end.
//!
//! Damping is along the gradient and relative to the target's own motion, so that it resists
//! vibration without holding the cloth back behind a moving shape.
//!
//! Source: Macklin, Müller & Chentanez 2016, *XPBD*, eqs. 18 and 26, with no multiplier
//! carried over, as there is one sweep per substep; separate compression as in nCloth.

use std::ops::Range;

use crate::machine::{Real, Vec3};

/// Lengths below this are taken for this. (mm)
const SHORTEST: f64 = 1e-12;

/// Rest lengths of a set of edges over one frame. (mm)
#[derive(Debug, Clone)]
pub(crate) struct RestLengths<R> {
    /// Length in the neutral shape.
    neutral: Vec<R>,
    /// Rest length at the start of the frame.
    start: Vec<R>,
    /// Rest length at the end of the frame.
    end: Vec<R>,
    /// How far the rest length follows the target, 0 = not at all, 1 = wholly.
    blend: Vec<R>,
    /// Factor of each edge's compliance; empty where all are 1.
    softness: Vec<R>,
}

impl<R: Real> RestLengths<R> {
    /// Lengths of `edges` in the neutral shape, with the blend of each edge.
    pub(crate) fn new(neutral: &[Vec3<R>], edges: &[[u32; 2]], blend: Vec<R>) -> Self {
        let lengths: Vec<R> = edges
            .iter()
            .map(|&[i, j]| edge_length(neutral[i as usize], neutral[j as usize]))
            .collect();
        Self {
            start: lengths.clone(),
            end: lengths.clone(),
            neutral: lengths,
            blend,
            softness: Vec::new(),
        }
    }

    /// The same, with a factor of each edge's compliance; none at all where all are 1.
    pub(crate) fn with_softness(self, softness: Vec<R>) -> Self {
        Self { softness, ..self }
    }

    /// Whether edges differ in softness.
    pub(crate) fn is_varied(&self) -> bool {
        !self.softness.is_empty()
    }

    /// Factor of an edge's compliance.
    #[inline(always)]
    pub(crate) fn softness(&self, edge: usize) -> R {
        if self.is_varied() {
            self.softness[edge]
        } else {
            R::splat(1.0)
        }
    }

    /// Starts a frame at whose end the targets are at `targets`. Returns the sum of squares by
    /// which targets and rest lengths will then differ, each over its softness. [mm^2]
    #[inline(always)]
    pub(crate) fn begin_frame(&mut self, edges: &[[u32; 2]], targets: &[Vec3<R>]) -> R {
        let mut mismatch = R::splat(0.0);
        for (edge, &[i, j]) in edges.iter().enumerate() {
            let target = edge_length(targets[i as usize], targets[j as usize]);
            let neutral = self.neutral[edge];
            let rest = neutral + self.blend[edge] * (target - neutral);
            self.start[edge] = self.end[edge];
            self.end[edge] = rest;
            let gap = target - rest;
            mismatch += gap * gap / self.softness(edge);
        }
        mismatch
    }

    /// Forgets motion: from now on rest lengths are those at the end of the frame.
    pub(crate) fn hold(&mut self) {
        self.start.copy_from_slice(&self.end);
    }

    /// Rest length at `progress` (0 to 1) through the frame.
    #[inline(always)]
    pub(crate) fn at(&self, edge: usize, progress: R) -> R {
        between(self.start[edge], self.end[edge], progress)
    }

    /// Those of some of the edges.
    #[inline(always)]
    pub(crate) fn part(&self, edges: Range<usize>) -> RestPart<'_, R> {
        RestPart {
            start: &self.start[edges.clone()],
            end: &self.end[edges.clone()],
            softness: if self.is_varied() {
                &self.softness[edges]
            } else {
                &[]
            },
        }
    }
}

/// [`RestLengths`] of successive edges.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestPart<'a, R> {
    start: &'a [R],
    end: &'a [R],
    /// Factor of each edge's compliance; empty where all are 1.
    pub(crate) softness: &'a [R],
}

impl<R: Real> RestPart<'_, R> {
    /// As [`RestLengths::at`].
    #[inline(always)]
    pub(crate) fn at(&self, edge: usize, progress: R) -> R {
        between(self.start[edge], self.end[edge], progress)
    }
}

/// A rest length on its way through a frame.
#[inline(always)]
fn between<R: Real>(start: R, end: R, progress: R) -> R {
    start + progress * (end - start)
}

/// Distance of two points by the very operations that the projection uses, so that an edge at
/// rest has exactly zero strain.
#[inline(always)]
pub(crate) fn edge_length<R: Real>(a: Vec3<R>, b: Vec3<R>) -> R {
    let d = a - b;
    d.dot(d).sqrt()
}

/// Compliances of distance constraints in one substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StretchCompliance<R> {
    /// 1/(k h_e^2) where the edge is too long. [1/mass]
    pub(crate) stretch: R,
    /// 1/(k h_e^2) where it is too short. [1/mass]
    pub(crate) compression: R,
    /// Damping of the constraint relative to its stiffness, beta/(k h_e).
    pub(crate) gamma: R,
}

impl<R: Real> StretchCompliance<R> {
    /// Of an edge whose compliance has a factor; its damping stays the same share of it.
    #[inline(always)]
    fn softened(&self, softness: R) -> Self {
        Self {
            stretch: self.stretch * softness,
            compression: self.compression * softness,
            gamma: self.gamma,
        }
    }
}

/// Projects one edge.
///
/// - `a`, `b`: positions (mm); `wa`, `wb`: inverse masses [1/mass]
/// - `rest`: l (mm)
/// - `resting`: a - b had both moved with their targets only (mm); damping acts on the
///   difference to it
///
/// Returns the corrections of a and b (mm): zero for coincident points, whose direction is
/// undefined.
#[inline(always)]
pub(crate) fn project_edge<R: Real>(
    a: Vec3<R>,
    b: Vec3<R>,
    wa: R,
    wb: R,
    rest: R,
    resting: Vec3<R>,
    compliance: &StretchCompliance<R>,
) -> (Vec3<R>, Vec3<R>) {
    let d = a - b;
    let squared = d.dot(d);
    let length = squared.sqrt();
    let c = length - rest;
    let alpha = R::select_less(c, R::splat(0.0), compliance.compression, compliance.stretch);
    let bottom = (wa + wb) * (R::splat(1.0) + compliance.gamma) + alpha;
    // Minus the multiplier over the length, so that `d` need not be normalized; everything
    // over the length squared, so that there is one division.
    let top = c * length + compliance.gamma * d.dot(d - resting);
    let s = top / (bottom * squared.max(R::splat(SHORTEST * SHORTEST)));
    (d * -(s * wa), d * (s * wb))
}

/// Projects edges of a grid.
///
/// - `positions`, `resting` (mm), `inv_masses` [1/mass]: one per node; see [`project_edge`]
/// - `rest`: one per edge
/// - `progress`: how far through the frame, 0 to 1
///
/// Without `IS_DAMPED` the compliance's damping counts as zero, and `resting` is not read;
/// without `IS_VARIED` the edges' softness is not.
#[inline(always)]
pub(crate) fn project_stretch<R: Real, const IS_DAMPED: bool, const IS_VARIED: bool>(
    edges: &[[u32; 2]],
    positions: &mut [Vec3<R>],
    inv_masses: &[R],
    rest: RestPart<'_, R>,
    resting: &[Vec3<R>],
    progress: R,
    compliance: &StretchCompliance<R>,
) {
    let compliance = if IS_DAMPED {
        *compliance
    } else {
        StretchCompliance {
            gamma: R::splat(0.0),
            ..*compliance
        }
    };
    for (edge, &[i, j]) in edges.iter().enumerate() {
        let (i, j) = (i as usize, j as usize);
        let compliance = if IS_VARIED {
            compliance.softened(rest.softness[edge])
        } else {
            compliance
        };
        let (a, b) = project_edge(
            positions[i],
            positions[j],
            inv_masses[i],
            inv_masses[j],
            rest.at(edge, progress),
            if IS_DAMPED {
                resting[i] - resting[j]
            } else {
                Vec3::zero()
            },
            &compliance,
        );
        positions[i] += a;
        positions[j] += b;
    }
}

/// Energy of all edges at a progress through the frame, `sum k C^2 / 2`: stretch and
/// compression.
#[inline(always)]
pub(crate) fn stretch_energy<R: Real>(
    edges: &[[u32; 2]],
    positions: &[Vec3<R>],
    (rest, progress): (&RestLengths<R>, R),
    k: [R; 2],
) -> [R; 2] {
    let mut sums = [R::splat(0.0); 2];
    for (edge, &[i, j]) in edges.iter().enumerate() {
        let (a, b) = (positions[i as usize], positions[j as usize]);
        let [s, c] = edge_energy(a, b, rest.at(edge, progress), k);
        let softness = rest.softness(edge);
        sums[0] += s / softness;
        sums[1] += c / softness;
    }
    sums
}

/// Energy of one edge, `k C^2 / 2`, split into stretch and compression.
#[inline(always)]
pub(crate) fn edge_energy<R: Real>(a: Vec3<R>, b: Vec3<R>, rest: R, k: [R; 2]) -> [R; 2] {
    let zero = R::splat(0.0);
    let c = edge_length(a, b) - rest;
    let half = R::splat(0.5) * c * c;
    [
        R::select_less(zero, c, half * k[0], zero),
        R::select_less(c, zero, half * k[1], zero),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Vec3<f64> = Vec3 {
        x: 1.0,
        y: 2.0,
        z: -0.5,
    };
    const B: Vec3<f64> = Vec3 {
        x: 2.5,
        y: 1.0,
        z: 0.25,
    };

    fn compliance(stretch: f64, compression: f64, gamma: f64) -> StretchCompliance<f64> {
        StretchCompliance {
            stretch,
            compression,
            gamma,
        }
    }

    #[test]
    fn the_correction_is_the_implicit_step_down_the_energy_gradient() {
        // One XPBD projection of a lone constraint solves its linearized implicit step:
        // dx = -w grad E(x + dx), with grad by central differences of the energy.
        let (wa, wb, k, rest) = (0.8, 0.3, 7.0, 1.5);
        let (da, db) = project_edge(
            A,
            B,
            wa,
            wb,
            rest,
            A - B,
            &compliance(1.0 / k, 1.0 / k, 0.0),
        );
        let energy = |a: Vec3<f64>| edge_energy(a, B + db, rest, [k, k]).iter().sum::<f64>();
        let step = 1e-6;
        for axis in 0..3 {
            let mut e = [0.0; 3];
            e[axis] = step;
            let e = Vec3::splat(e);
            let gradient = (energy(A + da + e) - energy(A + da - e)) / (2.0 * step);
            let moved = da.lane(0)[axis];
            assert!(
                (moved + wa * gradient).abs() < 1e-8,
                "axis {axis}: {moved} against {}",
                -wa * gradient
            );
        }
    }

    #[test]
    fn momentum_is_kept_and_a_rigid_edge_ends_at_its_rest_length() {
        let (da, db) = project_edge(A, B, 0.5, 2.0, 1.0, A - B, &compliance(0.0, 0.0, 0.0));
        assert!((edge_length(A + da, B + db) - 1.0).abs() < 1e-12);
        let momentum = da * (1.0 / 0.5) + db * (1.0 / 2.0);
        assert!(momentum.dot(momentum).sqrt() < 1e-14);
    }

    #[test]
    fn compression_has_its_own_compliance() {
        let long = edge_length(A, B) + 1.0;
        let soft = f64::INFINITY;
        let (da, _) = project_edge(A, B, 1.0, 1.0, long, A - B, &compliance(0.0, soft, 0.0));
        assert_eq!(da.dot(da), 0.0);
        let (da, _) = project_edge(A, B, 1.0, 1.0, 0.5, A - B, &compliance(0.0, soft, 0.0));
        assert!(da.dot(da) > 0.0);
    }

    #[test]
    fn damping_opposes_the_change_of_length_only() {
        let d = A - B;
        let rest = edge_length(A, B);
        let c = compliance(0.1, 0.1, 0.5);
        let sideways = d.cross(Vec3::splat([0.0, 0.0, 1.0]));
        let (da, _) = project_edge(A, B, 1.0, 1.0, rest, d - sideways, &c);
        assert!(da.dot(da).sqrt() < 1e-12, "no force across the edge");
        let (da, _) = project_edge(A, B, 1.0, 1.0, rest, d * 0.9, &c);
        assert!(da.dot(d) < 0.0, "a lengthening edge is pulled back");
    }

    #[test]
    fn coincident_and_nearly_coincident_points_get_finite_corrections() {
        for offset in [0.0, 1e-30, 1e-12, 1e-6] {
            let b = A + Vec3::splat([offset, 0.0, 0.0]);
            let (da, db) = project_edge(A, b, 1.0, 1.0, 1.0, A - b, &compliance(0.0, 0.0, 0.1));
            for v in [da, db] {
                let length = v.dot(v).sqrt();
                assert!(
                    length.is_finite() && length <= 0.5 + 1e-9,
                    "{offset}: {length}"
                );
            }
        }
    }
}
