//! Pressure: a fat pad keeps its volume.
//!
//! The pad's outer face is the patch; its base follows the target shape. What the pad has
//! gained is the volume swept from target to cloth: with displacements u = x - X,
//!
//! `C = sum over cells (mean of u over the corners) . A(X + u/2)`,
//!
//! where `A = d_1 x d_2 / 2` is the vector area of a cell, from its diagonals, at half the
//! displacement. It is exact for a translation and for a cell that turns in its plane, and of
//! third order otherwise. `E = k C^2 / 2`: the pad pushes back along its normals where it is
//! pressed, and swells elsewhere. One constraint per patch; its gradient is exact.
//!
//! Source: Müller et al. 2007, *Position based dynamics*, section 4.4 (cloth balloons),
//! written for a sheet over a base; XPBD eq. 18.

use crate::cloth::lanes::{Real, Vec3};

/// Volume gained [mm^3], with its gradient by node [mm^2] written into `gradient`.
///
/// - `targets`, `displacements`: one per node (mm)
#[inline(always)]
pub(crate) fn swept_volume<R: Real>(
    cells: &[[u32; 4]],
    targets: &[Vec3<R>],
    displacements: &[Vec3<R>],
    gradient: &mut [Vec3<R>],
) -> R {
    let (quarter, half) = (R::splat(0.25), R::splat(0.5));
    gradient.fill(Vec3::zero());
    let mut volume = R::splat(0.0);
    for cell in cells {
        let &[a, b, c, d] = cell;
        let (a, b, c, d) = (a as usize, b as usize, c as usize, d as usize);
        let (ua, ub, uc, ud) = (
            displacements[a],
            displacements[b],
            displacements[c],
            displacements[d],
        );
        let first = targets[c] - targets[a] + (uc - ua) * half;
        let second = targets[d] - targets[b] + (ud - ub) * half;
        let area = first.cross(second) * half;
        let mean = (ua + ub + uc + ud) * quarter;
        volume += mean.dot(area);
        let lift = area * quarter;
        let turn_first = second.cross(mean) * quarter;
        let turn_second = mean.cross(first) * quarter;
        gradient[a] += lift - turn_first;
        gradient[b] += lift - turn_second;
        gradient[c] += lift + turn_first;
        gradient[d] += lift + turn_second;
    }
    volume
}

/// Projects the volume of one patch.
///
/// - `displacements` (mm), `inv_masses` [1/mass]: one per node
/// - `compliance`: 1/(k h_e^2) [mm^4/mass], infinite for no pressure
/// - `gradient`: room for one vector per node
#[inline(always)]
pub(crate) fn project_pressure<R: Real>(
    cells: &[[u32; 4]],
    targets: &[Vec3<R>],
    displacements: &mut [Vec3<R>],
    inv_masses: &[R],
    compliance: R,
    gradient: &mut [Vec3<R>],
) {
    let volume = swept_volume(cells, targets, displacements, gradient);
    // A patch with no area has no gradient; the bound keeps the division finite.
    let mut bottom = compliance.max(R::splat(1e-30));
    for (g, &w) in gradient.iter().zip(inv_masses) {
        bottom += g.dot(*g) * w;
    }
    let lambda = -(volume / bottom);
    for ((x, g), &w) in displacements
        .iter_mut()
        .zip(gradient.iter())
        .zip(inv_masses)
    {
        *x += *g * (lambda * w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::GridShape;
    use crate::cloth::constraints::grid_lists::GridLists;

    fn cells(shape: GridShape) -> Vec<[u32; 4]> {
        GridLists::new(shape).cells
    }

    fn pad(shape: GridShape, height: impl Fn(f64, f64) -> f64) -> Vec<Vec3<f64>> {
        let mut nodes = Vec::new();
        for v in 0..shape.v_count {
            for u in 0..shape.u_count {
                let (x, y) = (f64::from(u), f64::from(v));
                nodes.push(Vec3::splat([x, y, height(x, y)]));
            }
        }
        nodes
    }

    const SHAPE: GridShape = GridShape {
        u_count: 9,
        v_count: 7,
        is_periodic: false,
    };

    #[test]
    fn lifting_a_pad_sweeps_area_times_height() {
        let targets = pad(SHAPE, |x, y| 0.1 * x * y);
        let lift = vec![Vec3::splat([0.0, 0.0, 0.5]); targets.len()];
        let mut gradient = targets.clone();
        let volume = swept_volume(&cells(SHAPE), &targets, &lift, &mut gradient);
        assert!((volume - 8.0 * 6.0 * 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_growing_sphere_gains_its_shell() {
        let (n, m) = (200_u32, 101_u32);
        let shape = GridShape {
            u_count: n,
            v_count: m,
            is_periodic: true,
        };
        let mut targets = Vec::new();
        for v in 0..m {
            for u in 0..n {
                let phi = f64::from(u) / f64::from(n) * std::f64::consts::TAU;
                let theta = std::f64::consts::PI * (1.0 - f64::from(v) / f64::from(m - 1));
                let (s, c) = theta.sin_cos();
                targets.push(Vec3::splat([
                    10.0 * s * phi.cos(),
                    10.0 * s * phi.sin(),
                    10.0 * c,
                ]));
            }
        }
        let grown: Vec<_> = targets.iter().map(|p| *p * 0.1).collect();
        let mut gradient = targets.clone();
        let volume = swept_volume(&cells(shape), &targets, &grown, &mut gradient);
        let shell = 4.0 / 3.0 * std::f64::consts::PI * (11.0_f64.powi(3) - 1000.0);
        assert!((volume / shell - 1.0).abs() < 2e-3, "{volume} {shell}");
    }

    #[test]
    fn the_gradient_is_exact() {
        let targets = pad(SHAPE, |x, y| (0.4 * x).sin() + 0.2 * y * y);
        for scale in [1e-12, 0.3] {
            let shift: Vec<_> = (0..targets.len())
                .map(|i| {
                    let t = i as f64;
                    Vec3::splat([
                        t.sin() * scale,
                        (2.0 * t).cos() * scale,
                        (3.0 * t).sin() * scale,
                    ])
                })
                .collect();
            let mut gradient = targets.clone();
            swept_volume(&cells(SHAPE), &targets, &shift, &mut gradient);
            let mut scratch = targets.clone();
            for node in [0, 8, 20, 31, 62] {
                for axis in 0..3 {
                    let mut e = [0.0; 3];
                    e[axis] = 1e-5;
                    let mut plus = shift.clone();
                    plus[node] += Vec3::splat(e);
                    let mut minus = shift.clone();
                    minus[node] -= Vec3::splat(e);
                    let slope = (swept_volume(&cells(SHAPE), &targets, &plus, &mut scratch)
                        - swept_volume(&cells(SHAPE), &targets, &minus, &mut scratch))
                        / 2e-5;
                    assert!((slope - gradient[node].lane(0)[axis]).abs() < 1e-7);
                }
            }
        }
    }

    #[test]
    fn a_pressed_pad_swells_elsewhere_until_its_volume_is_back() {
        let targets = pad(SHAPE, |_, _| 0.0);
        let mut shift = vec![Vec3::<f64>::zero(); targets.len()];
        shift[31].z = -1.0;
        let mut gradient = targets.clone();
        let w = vec![1.0; targets.len()];
        for _ in 0..3 {
            project_pressure(&cells(SHAPE), &targets, &mut shift, &w, 0.0, &mut gradient);
        }
        let volume = swept_volume(&cells(SHAPE), &targets, &shift, &mut gradient);
        assert!(volume.abs() < 1e-9, "{volume}");
        assert!(shift[30].z > 0.0 && shift[31].z < 0.0);
    }

    #[test]
    fn a_patch_without_area_is_left_alone() {
        let targets = vec![Vec3::<f64>::zero(); 63];
        let mut shift = targets.clone();
        let mut gradient = targets.clone();
        project_pressure(
            &cells(SHAPE),
            &targets,
            &mut shift,
            &[1.0; 63],
            0.0,
            &mut gradient,
        );
        assert!(shift.iter().all(|u| u.dot(*u) == 0.0));
    }
}
