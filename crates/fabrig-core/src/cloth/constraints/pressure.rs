//! Pressure: a fat pad keeps its volume.
//!
//! The pad's outer face is the patch; its inner face is the floor, what lies under it: the nodes
//! it is stitched to, wherever they have gone. With heights `H = X - F` from the targets of the
//! floor to those of the pad, and displacements u of the pad and g of the floor, the volume is that
//! of the cells' hexahedra by the midpoint rule,
//!
//! `V = sum over cells (mean of H + u - g over the corners) . A(X + u - (H + u - g)/2)`,
//!
//! where `A = d_1 x d_2 / 2` is the vector area of a cell of the surface half-way up, from its
//! diagonals. `C = V - V_0`, with `V_0` the volume between the targets, and `E = k C^2 / 2`: the
//! pad pushes back along its normals where it is pressed, and swells elsewhere. One constraint
//! per patch; its gradient by u is exact. A pad over nothing has its own target for a floor,
//! `H = g = 0`, and C is what it has swept from there: exact for a translation and for a cell
//! that turns in its plane, and of third order otherwise.
//!
//! The pressure acts on the pad alone: the floor feels it through the stitches.
//!
//! Source: Müller et al. 2007, *Position based dynamics*, section 4.4 (cloth balloons),
//! written for a sheet over a floor; XPBD eq. 18.

use crate::machine::{Real, Vec3};

/// What a pad's volume is between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PadFaces<'a, R> {
    /// Corners of each cell.
    pub(crate) cells: &'a [[u32; 4]],
    /// Targets of the pad, one per node. (mm)
    pub(crate) targets: &'a [Vec3<R>],
    /// From the floor, where it is now, to the target: `H - g`, one per node. (mm)
    pub(crate) heights: &'a [Vec3<R>],
}

/// Volume between floor and pad [mm^3], with its gradient by node [mm^2] written into
/// `gradient`.
///
/// - `displacements`: of the pad, one per node (mm)
#[inline(always)]
pub(crate) fn pad_volume<R: Real>(
    faces: &PadFaces<'_, R>,
    displacements: &[Vec3<R>],
    gradient: &mut [Vec3<R>],
) -> R {
    let PadFaces {
        cells,
        targets,
        heights,
    } = *faces;
    let (quarter, half) = (R::splat(0.25), R::splat(0.5));
    gradient.fill(Vec3::zero());
    let mut volume = R::splat(0.0);
    for cell in cells {
        let [a, b, c, d] = cell.map(|node| node as usize);
        let (ua, ub, uc, ud) = (
            displacements[a],
            displacements[b],
            displacements[c],
            displacements[d],
        );
        let (ha, hb, hc, hd) = (heights[a], heights[b], heights[c], heights[d]);
        let first = targets[c] - targets[a] + ((uc - ua) - (hc - ha)) * half;
        let second = targets[d] - targets[b] + ((ud - ub) - (hd - hb)) * half;
        let area = first.cross(second) * half;
        let mean = ((ua + ub + uc + ud) + (ha + hb + hc + hd)) * quarter;
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
/// - `rest`: V_0 [mm^3]
/// - `displacements` (mm), `inv_masses` [1/mass]: one per node
/// - `compliance`: 1/(k h_e^2) [mm^4/mass], infinite for no pressure
/// - `gradient`: room for one vector per node
#[inline(always)]
pub(crate) fn project_pressure<R: Real>(
    faces: &PadFaces<'_, R>,
    rest: R,
    displacements: &mut [Vec3<R>],
    inv_masses: &[R],
    compliance: R,
    gradient: &mut [Vec3<R>],
) {
    let gained = pad_volume(faces, displacements, gradient) - rest;
    // A patch with no area has no gradient; the bound keeps the division finite.
    let mut bottom = compliance.max(R::splat(1e-30));
    for (g, &w) in gradient.iter().zip(inv_masses) {
        bottom += g.dot(*g) * w;
    }
    let lambda = -(gained / bottom);
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

    /// Volume of a pad, with its gradient.
    fn volume(
        shape: GridShape,
        targets: &[Vec3<f64>],
        heights: &[Vec3<f64>],
        displacements: &[Vec3<f64>],
        gradient: &mut [Vec3<f64>],
    ) -> f64 {
        let faces = PadFaces {
            cells: &cells(shape),
            targets,
            heights,
        };
        pad_volume(&faces, displacements, gradient)
    }

    /// Volume swept by a pad over nothing.
    fn swept(shape: GridShape, targets: &[Vec3<f64>], displacements: &[Vec3<f64>]) -> f64 {
        let nothing = vec![Vec3::zero(); targets.len()];
        let mut gradient = nothing.clone();
        volume(shape, targets, &nothing, displacements, &mut gradient)
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
        let gained = swept(SHAPE, &targets, &lift);
        assert!((gained - 8.0 * 6.0 * 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_pad_over_a_floor_holds_what_is_between() {
        // A slab that leans: its volume is its height times the vector area of its saddle, of which
        // x and y are the mean slopes 0.1 * 3 and 0.1 * 4 times the 48 mm^2 that z is.
        let targets = pad(SHAPE, |x, y| 0.1 * x * y);
        let heights = vec![Vec3::splat([0.4, -0.2, 3.0]); targets.len()];
        let mut gradient = targets.clone();
        let still = vec![Vec3::zero(); targets.len()];
        let at_rest = volume(SHAPE, &targets, &heights, &still, &mut gradient);
        let expected = 48.0 * (3.0 - 0.4 * 0.3 + 0.2 * 0.4);
        assert!((at_rest - expected).abs() < 1e-9, "{at_rest} {expected}");
        // Pad and floor go the same way: nothing is gained.
        let gone = Vec3::splat([0.7, -0.3, 1.1]);
        let floor: Vec<_> = heights.iter().map(|h| *h - gone).collect();
        let away = vec![gone; targets.len()];
        let together = volume(SHAPE, &targets, &floor, &away, &mut gradient);
        assert!((together - at_rest).abs() < 1e-9, "{together} {at_rest}");
        // The floor alone sinks: as much is gained as it sweeps.
        let sunk: Vec<_> = heights
            .iter()
            .map(|h| *h + Vec3::splat([0.0, 0.0, 0.5]))
            .collect();
        let over = volume(SHAPE, &targets, &sunk, &still, &mut gradient);
        assert!((over - at_rest - 8.0 * 6.0 * 0.5).abs() < 1e-9);
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
        let gained = swept(shape, &targets, &grown);
        let shell = 4.0 / 3.0 * std::f64::consts::PI * (11.0_f64.powi(3) - 1000.0);
        assert!((gained / shell - 1.0).abs() < 2e-3, "{gained} {shell}");
        // The same shell, as a pad over a sphere.
        let mut gradient = targets.clone();
        let outer: Vec<_> = targets.iter().map(|p| *p * 1.1).collect();
        let still = vec![Vec3::zero(); targets.len()];
        let held = volume(shape, &outer, &grown, &still, &mut gradient);
        assert!((held / shell - 1.0).abs() < 2e-3, "{held} {shell}");
    }

    #[test]
    fn the_gradient_is_exact() {
        let targets = pad(SHAPE, |x, y| (0.4 * x).sin() + 0.2 * y * y);
        let nothing = vec![Vec3::zero(); targets.len()];
        let floor: Vec<_> = (0..targets.len())
            .map(|i| Vec3::splat([0.3 * (i as f64).cos(), 0.1, 2.0 + (0.7 * i as f64).sin()]))
            .collect();
        for (scale, heights) in [(1e-12, &nothing), (0.3, &nothing), (0.3, &floor)] {
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
            volume(SHAPE, &targets, heights, &shift, &mut gradient);
            let mut scratch = targets.clone();
            for node in [0, 8, 20, 31, 62] {
                for axis in 0..3 {
                    let mut e = [0.0; 3];
                    e[axis] = 1e-5;
                    let mut plus = shift.clone();
                    plus[node] += Vec3::splat(e);
                    let mut minus = shift.clone();
                    minus[node] -= Vec3::splat(e);
                    let slope = (volume(SHAPE, &targets, heights, &plus, &mut scratch)
                        - volume(SHAPE, &targets, heights, &minus, &mut scratch))
                        / 2e-5;
                    assert!((slope - gradient[node].lane(0)[axis]).abs() < 1e-7);
                }
            }
        }
    }

    #[test]
    fn a_pressed_pad_swells_elsewhere_until_its_volume_is_back() {
        let targets = pad(SHAPE, |_, _| 0.0);
        let nothing = vec![Vec3::<f64>::zero(); targets.len()];
        let floor = vec![Vec3::splat([0.0, 0.0, 2.0]); targets.len()];
        for heights in [&nothing, &floor] {
            let mut shift = nothing.clone();
            let mut gradient = targets.clone();
            let rest = volume(SHAPE, &targets, heights, &shift, &mut gradient);
            shift[31].z = -1.0;
            let w = vec![1.0; targets.len()];
            let faces = PadFaces {
                cells: &cells(SHAPE),
                targets: &targets,
                heights,
            };
            for _ in 0..3 {
                project_pressure(&faces, rest, &mut shift, &w, 0.0, &mut gradient);
            }
            let after = volume(SHAPE, &targets, heights, &shift, &mut gradient);
            assert!((after - rest).abs() < 1e-9, "{after} {rest}");
            assert!(shift[30].z > 0.0 && shift[31].z < 0.0);
        }
    }

    #[test]
    fn a_patch_without_area_is_left_alone() {
        let nothing = vec![Vec3::<f64>::zero(); 63];
        let (mut shift, mut gradient) = (nothing.clone(), nothing.clone());
        let faces = PadFaces {
            cells: &cells(SHAPE),
            targets: &nothing,
            heights: &nothing,
        };
        project_pressure(&faces, 0.0, &mut shift, &[1.0; 63], 0.0, &mut gradient);
        assert!(shift.iter().all(|u| u.dot(*u) == 0.0));
    }
}
