//! Bending along grid lines, with angle dropoff.
//!
//! For three nodes in a row along u or v, with displacements u = x - X from their targets, the
//! second difference `s = u_i - 2 u_j + u_k` is how much the line bends more than its target
//! does. With the mean edge length L, `q = |s|^2 / L^2` is the square of the extra bend angle
//! (for small angles), and
//!
//! `E = k L^2/2 q (1 - d / (1 + q))`, so that `-dE/ds = -k (1 - d / (1 + q)^2) s`:
//!
//! with dropoff d = 0 every angle is resisted alike; with larger d the nearly flat cloth
//! bends more easily and only sharp folds are resisted fully, as nCloth describes it.
//! The target's own curvature is the rest curvature, whatever `rest_blend` is: it turns with
//! the target, so a jaw that opens bends nothing.
//!
//! Source: the quadratic second difference of Bergou et al. 2006, *A quadratic bending model
//! for inextensible surfaces*, on a regular grid; projection as a vector-valued XPBD
//! constraint (Macklin et al. 2016, eq. 18) with the dropoff at its current value.

use crate::machine::{Real, Vec3};

/// Bending of one substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BendCompliance<R> {
    /// 1/(k h_e^2). [1/mass]
    pub(crate) compliance: R,
    /// Angle dropoff d, 0 to 1.
    pub(crate) dropoff: R,
    /// 1 / L^2 of the mean edge. [1/mm^2]
    pub(crate) inv_edge_squared: R,
}

/// Projects one triple.
///
/// - `a`, `b`, `c`: displacements from the targets, b between the others (mm)
/// - `w`: inverse masses [1/mass]
///
/// Returns the multiplier: the corrections are `w_a`, `-2 w_b` and `w_c` times it [mm mass].
#[inline(always)]
pub(crate) fn project_triple<R: Real>(
    a: Vec3<R>,
    b: Vec3<R>,
    c: Vec3<R>,
    w: [R; 3],
    bend: &BendCompliance<R>,
) -> Vec3<R> {
    let one = R::splat(1.0);
    let s = a + c - b - b;
    let turned = one + s.dot(s) * bend.inv_edge_squared;
    // compliance / (1 - d/(1 + q)^2), multiplied through to need one division.
    let turned = turned * turned;
    let part = turned - bend.dropoff;
    let sum = w[0] + w[2] + R::splat(4.0) * w[1];
    s * -(part / (sum * part + bend.compliance * turned))
}

/// Projects triples of a grid.
///
/// - `displacements` (mm), `inv_masses` [1/mass]: one per node
/// - `softness`: factor of each triple's compliance, not read without `IS_VARIED`
#[inline(always)]
pub(crate) fn project_bend<R: Real, const IS_VARIED: bool>(
    triples: &[[u32; 3]],
    displacements: &mut [Vec3<R>],
    inv_masses: &[R],
    bend: &BendCompliance<R>,
    softness: &[R],
) {
    let two = R::splat(2.0);
    for (index, triple) in triples.iter().enumerate() {
        let &[i, j, k] = triple;
        let (i, j, k) = (i as usize, j as usize, k as usize);
        let w = [inv_masses[i], inv_masses[j], inv_masses[k]];
        let (a, b, c) = (displacements[i], displacements[j], displacements[k]);
        let lambda = if IS_VARIED {
            let bend = BendCompliance {
                compliance: bend.compliance * softness[index],
                ..*bend
            };
            project_triple(a, b, c, w, &bend)
        } else {
            project_triple(a, b, c, w, bend)
        };
        displacements[i] = a + lambda * w[0];
        displacements[j] = b - lambda * (two * w[1]);
        displacements[k] = c + lambda * w[2];
    }
}

/// Energy of all triples.
///
/// - `softness`: factor of each triple's compliance; empty where all are 1
#[inline(always)]
pub(crate) fn bend_energy<R: Real>(
    triples: &[[u32; 3]],
    displacements: &[Vec3<R>],
    k: R,
    bend: &BendCompliance<R>,
    softness: &[R],
) -> R {
    let mut sum = R::splat(0.0);
    for (index, triple) in triples.iter().enumerate() {
        let &[i, j, l] = triple;
        let (i, j, l) = (i as usize, j as usize, l as usize);
        let s = displacements[i] + displacements[l] - displacements[j] - displacements[j];
        let q = s.dot(s) * bend.inv_edge_squared;
        let energy = q * (R::splat(1.0) - bend.dropoff / (R::splat(1.0) + q));
        sum += softness.get(index).map_or(energy, |&s| energy / s);
    }
    R::splat(0.5) * k / bend.inv_edge_squared * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &[[u32; 3]] = &[[0, 1, 2]];

    fn bend(compliance: f64, dropoff: f64) -> BendCompliance<f64> {
        BendCompliance {
            compliance,
            dropoff,
            inv_edge_squared: 0.25,
        }
    }

    #[test]
    fn the_force_is_the_energy_gradient() {
        let k = 3.0;
        let b = bend(0.0, 0.3);
        for scale in [1e-6, 1e-2, 1.0, 30.0] {
            let nodes = [[0.1, 0.2, 0.0], [0.0, 0.7, 0.3], [-0.2, 0.1, 0.5]]
                .map(|p| Vec3::splat(p.map(|x: f64| x * scale)));
            // A very soft constraint moves by force / mass: here multiplier = force.
            let soft = bend(1e12, 0.3);
            let lambda = project_triple(nodes[0], nodes[1], nodes[2], [1.0; 3], &soft);
            let force = lambda * (1e12 * k);
            let step = 1e-6 * scale;
            for axis in 0..3 {
                let mut e = [0.0; 3];
                e[axis] = step;
                let mut plus = nodes;
                plus[0] += Vec3::splat(e);
                let mut minus = nodes;
                minus[0] -= Vec3::splat(e);
                let slope = (bend_energy(LINE, &plus, k, &b, &[])
                    - bend_energy(LINE, &minus, k, &b, &[]))
                    / (2.0 * step);
                let f = force.lane(0)[axis];
                assert!(
                    (f + slope).abs() < 1e-6 * scale * k,
                    "{scale} {axis}: {f} {slope}"
                );
            }
        }
    }

    #[test]
    fn a_rigid_triple_becomes_straight_and_keeps_momentum() {
        let mut nodes = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [2.0, 0.0, 1.0]].map(Vec3::splat);
        let w = [0.5, 0.25, 1.0];
        let start = nodes;
        project_bend::<_, false>(LINE, &mut nodes, &w, &bend(0.0, 0.2), &[]);
        let s: Vec3<f64> = nodes[0] + nodes[2] - nodes[1] - nodes[1];
        assert!(s.dot(s).sqrt() < 1e-12);
        let mut momentum = Vec3::<f64>::zero();
        for i in 0..3 {
            momentum += (nodes[i] - start[i]) * (1.0 / w[i]);
        }
        assert!(momentum.dot(momentum).sqrt() < 1e-12);
    }

    #[test]
    fn dropoff_weakens_small_angles_more_than_large_ones() {
        let ratio = |size: f64| {
            let b = Vec3::splat([0.0, size, 0.0]);
            let zero = Vec3::zero();
            let with = project_triple(zero, b, zero, [1.0; 3], &bend(1e9, 0.8));
            let without = project_triple(zero, b, zero, [1.0; 3], &bend(1e9, 0.0));
            with.y / without.y
        };
        assert!((ratio(1e-4) - 0.2).abs() < 1e-6);
        assert!(ratio(10.0) > 0.95);
    }

    #[test]
    fn a_straight_triple_with_the_largest_dropoff_is_left_alone() {
        let zero = Vec3::<f64>::zero();
        let lambda = project_triple(zero, zero, zero, [1.0; 3], &bend(0.0, 0.999));
        assert_eq!(lambda.dot(lambda), 0.0);
    }
}
