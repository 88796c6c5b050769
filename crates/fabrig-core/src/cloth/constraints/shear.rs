//! Shear: both diagonals of every cell keep their rest length.
//!
//! `C = |x_i - x_j| - l` over the diagonals (u, v)-(u+1, v+1) and (u+1, v)-(u, v+1), with the
//! rest lengths, compliance and projection of [`super::stretch`], one compliance for both
//! signs and no damping of its own. nCloth calls these cross links.
//!
//! Source: Provot 1995, *Deformation constraints in a mass-spring model*, shear springs.

use super::stretch::{RestLengths, RestPart, edge_length};
use crate::machine::{Real, Vec3};

/// Projects one diagonal.
///
/// - `a`, `b`: positions (mm); `wa`, `wb`: inverse masses [1/mass]
/// - `rest`: l (mm); `compliance`: 1/(k h_e^2) [1/mass]
///
/// Returns the corrections of a and b (mm): zero for coincident points.
#[inline(always)]
pub(crate) fn project_diagonal<R: Real>(
    a: Vec3<R>,
    b: Vec3<R>,
    wa: R,
    wb: R,
    rest: R,
    compliance: R,
) -> (Vec3<R>, Vec3<R>) {
    let d = a - b;
    let length = d.dot(d).sqrt();
    let bottom = (wa + wb + compliance) * length.max(R::splat(1e-12));
    let s = (length - rest) / bottom;
    (d * -(s * wa), d * (s * wb))
}

/// Projects diagonals of a grid.
///
/// - `positions` (mm), `inv_masses` [1/mass]: one per node
/// - `rest`: one per diagonal
/// - `progress`: how far through the frame, 0 to 1
///
/// Without `IS_VARIED` the diagonals' softness is not read.
#[inline(always)]
pub(crate) fn project_shear<R: Real, const IS_VARIED: bool>(
    diagonals: &[[u32; 2]],
    positions: &mut [Vec3<R>],
    inv_masses: &[R],
    rest: RestPart<'_, R>,
    progress: R,
    compliance: R,
) {
    for (diagonal, &[i, j]) in diagonals.iter().enumerate() {
        let (i, j) = (i as usize, j as usize);
        let (da, db) = project_diagonal(
            positions[i],
            positions[j],
            inv_masses[i],
            inv_masses[j],
            rest.at(diagonal, progress),
            if IS_VARIED {
                compliance * rest.softness[diagonal]
            } else {
                compliance
            },
        );
        positions[i] += da;
        positions[j] += db;
    }
}

/// Energy of all diagonals at a progress through the frame, `sum k C^2 / 2`.
#[inline(always)]
pub(crate) fn shear_energy<R: Real>(
    diagonals: &[[u32; 2]],
    positions: &[Vec3<R>],
    (rest, progress): (&RestLengths<R>, R),
    k: R,
) -> R {
    let mut sum = R::splat(0.0);
    for (diagonal, &[i, j]) in diagonals.iter().enumerate() {
        let (i, j) = (i as usize, j as usize);
        let c = edge_length(positions[i], positions[j]) - rest.at(diagonal, progress);
        sum += R::splat(0.5) * k * c * c / rest.softness(diagonal);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth::constraints::stretch::{StretchCompliance, project_edge};

    #[test]
    fn it_is_the_undamped_edge_projection() {
        let a = Vec3::<f64>::splat([0.3, 1.0, 2.0]);
        let b = Vec3::<f64>::splat([-0.4, 0.2, 1.1]);
        for rest in [0.5, 3.0] {
            let plain = StretchCompliance {
                stretch: 0.2,
                compression: 0.2,
                gamma: 0.0,
            };
            let expected = project_edge(a, b, 0.7, 0.4, rest, a - b, &plain);
            let actual = project_diagonal(a, b, 0.7, 0.4, rest, 0.2);
            for (e, x) in [(expected.0, actual.0), (expected.1, actual.1)] {
                let gap = e - x;
                assert!(gap.dot(gap).sqrt() < 1e-14);
            }
        }
    }

    #[test]
    fn a_sheared_square_is_pulled_upright_and_a_coincident_one_stays_finite() {
        let diagonals = [[0, 3], [1, 2]];
        let square = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let neutral: Vec<Vec3<f64>> = square
            .iter()
            .map(|p| Vec3::splat([p[0], p[1], 0.0]))
            .collect();
        let rest = RestLengths::new(&neutral, &diagonals, vec![0.0; 2]);
        let mut sheared: Vec<_> = square
            .iter()
            .map(|p| Vec3::splat([p[0] + 0.3 * p[1], p[1], 0.0]))
            .collect();
        let before = shear_energy(&diagonals, &sheared, (&rest, 1.0), 2.0);
        project_shear::<_, false>(
            &diagonals,
            &mut sheared,
            &[1.0; 4],
            rest.part(0..2),
            1.0,
            0.0,
        );
        let after = shear_energy(&diagonals, &sheared, (&rest, 1.0), 2.0);
        assert!(after < 0.05 * before, "{before} -> {after}");
        let mut heap = vec![Vec3::<f64>::zero(); 4];
        project_shear::<_, false>(&diagonals, &mut heap, &[1.0; 4], rest.part(0..2), 1.0, 0.0);
        assert!(heap.iter().all(|p| p.dot(*p).is_finite()));
    }
}
