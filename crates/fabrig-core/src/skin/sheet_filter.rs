//! Skin as a sheet of its own: it does not follow every buckle of what lies under it.
//!
//! A patch under a steady load (a head that lies down, wind) is shorter than its lengths at rest
//! somewhere, and a grid that is too short folds, a few edges to a fold. Dermis and the fat right
//! under it are millimetres thick and bridge such folds. So skin takes from a patch
//!
//! `q' = q + m (G u - u)`, `u = q - X`
//!
//! where `q` are its nodes, `X` where its muscle shapes want them, and `G` is a Gaussian along
//! both ways of the grid, cut off at [`REACH`] widths and repeating the edge beyond the edge. It
//! keeps `exp(-2 pi^2 s^2 / L^2)` of what has wavelength L. The shapes themselves, the artist's
//! word, pass as they are. `m` is 1 but where skin is to fold or to meet other skin: there it
//! is 0, and nodes pass bit for bit.
//!
//! Rows of `G` are positive and sum to one, so no node's error grows on the way to the skin.

use nalgebra::Point3;

use crate::anatomy::GridShape;
use crate::machine::vectorized;

/// Where the Gaussian is cut off, in its widths.
const REACH: f32 = 2.5;
/// No further than this many nodes, however fine the grid is.
const MOST_TAPS: usize = 32;

/// Takes from the motion of one patch what is too fine for skin.
#[derive(Debug, Clone, PartialEq)]
pub struct SheetFilter {
    grid: GridShape,
    /// Half a kernel along u and along v: at the node, one away, two away, ...
    along: [Vec<f32>; 2],
    /// `m` of each number of the nodes.
    share: Vec<f32>,
    scratch: Scratch,
}

/// Motions as plain numbers, x y z after each other.
#[derive(Debug, Clone, Default, PartialEq)]
struct Scratch {
    /// `u`.
    own: Vec<f32>,
    /// One row of it, with what is repeated beyond its ends.
    row: Vec<f32>,
    filtered_along_u: Vec<f32>,
    /// `G u`.
    filtered: Vec<f32>,
}

impl SheetFilter {
    /// - `rest`: nodes at rest (mm), as many as `grid` has
    /// - `width`: of the Gaussian, its standard deviation (mm); 0 filters nothing
    /// - `share`: how much is filtered at each node, 0 to 1
    ///
    /// # Panics
    ///
    /// If `rest` or `share` is not one per node.
    pub fn new(grid: GridShape, rest: &[Point3<f32>], width: f32, share: Vec<f32>) -> Self {
        assert_eq!([rest.len(), share.len()], [grid.node_count(); 2]);
        let mean_edge = |is_along: fn(GridShape, u32, u32) -> Option<(u32, u32)>| {
            let nodes = (0..grid.v_count).flat_map(|v| (0..grid.u_count).map(move |u| (u, v)));
            let edges = nodes.filter_map(|(u, v)| Some(((u, v), is_along(grid, u, v)?)));
            let at = |(u, v): (u32, u32)| rest[grid.index(u, v)];
            let (sum, count) = edges.fold((0.0, 0.0), |(sum, count), (a, b)| {
                (sum + (at(a) - at(b)).norm(), count + 1.0)
            });
            sum / count
        };
        let edges = [mean_edge(next_along_u), mean_edge(next_along_v)];
        let room = [grid.u_count, grid.v_count];
        let along = [0, 1].map(|k| half_gaussian(width / edges[k], room[k] as usize));
        Self {
            grid,
            along,
            share: share.iter().flat_map(|&m| [m; 3]).collect(),
            scratch: Scratch::default(),
        }
    }

    /// Whether all nodes pass as they are.
    pub fn is_idle(&self) -> bool {
        self.along.iter().all(|taps| taps.len() < 2) || self.share.iter().all(|&m| m == 0.0)
    }

    /// What skin takes of the patch.
    ///
    /// - `nodes`: where they are (mm); `targets`: where the muscle shapes want them (mm)
    /// - `out`: receives the nodes for the skin (mm)
    ///
    /// # Panics
    ///
    /// If any of them is not one per node.
    pub fn apply(
        &mut self,
        nodes: &[Point3<f32>],
        targets: &[Point3<f32>],
        out: &mut [Point3<f32>],
    ) {
        let counts = [nodes.len(), targets.len(), out.len()].map(|count| 3 * count);
        assert_eq!(counts, [self.share.len(); 3]);
        vectorized(Apply {
            filter: self,
            nodes,
            targets,
            out,
        });
    }

    #[inline(always)]
    fn take(&mut self, nodes: &[f32], targets: &[f32], out: &mut [f32]) {
        let Scratch { own, filtered, .. } = &mut self.scratch;
        own.clear();
        own.extend(
            nodes
                .iter()
                .zip(targets)
                .map(|(node, target)| node - target),
        );
        filtered.resize(own.len(), 0.0);
        self.filter_along_u();
        self.filter_along_v();
        let Scratch { own, filtered, .. } = &self.scratch;
        let ways = own.iter().zip(filtered);
        let nodes = nodes.iter().zip(&self.share).zip(out);
        for ((own, filtered), ((node, share), out)) in ways.zip(nodes) {
            *out = node + share * (filtered - own);
        }
    }

    #[inline(always)]
    fn filter_along_u(&mut self) {
        let taps = &self.along[0];
        let (width, pad) = (3 * self.grid.u_count as usize, 3 * (taps.len() - 1));
        let Scratch {
            own,
            row: padded,
            filtered_along_u,
            ..
        } = &mut self.scratch;
        padded.resize(width + 2 * pad, 0.0);
        filtered_along_u.resize(own.len(), 0.0);
        let rows = own.chunks_exact(width);
        for (row, out) in rows.zip(filtered_along_u.chunks_exact_mut(width)) {
            padded[pad..pad + width].copy_from_slice(row);
            for k in 0..pad {
                let (before, after) = if self.grid.is_periodic {
                    (width - pad + k, k)
                } else {
                    (k % 3, width - 3 + k % 3)
                };
                padded[k] = row[before];
                padded[pad + width + k] = row[after];
            }
            let shifted = |by: usize| &padded[by..by + width];
            scale(out, row, taps[0]);
            for (step, &tap) in taps.iter().enumerate().skip(1) {
                add_pair(out, shifted(pad - 3 * step), shifted(pad + 3 * step), tap);
            }
        }
    }

    #[inline(always)]
    fn filter_along_v(&mut self) {
        let taps = &self.along[1];
        let width = 3 * self.grid.u_count as usize;
        let last = (self.grid.v_count as usize).saturating_sub(1);
        let Scratch {
            filtered_along_u,
            filtered,
            ..
        } = &mut self.scratch;
        let row = |v: usize| &filtered_along_u[v * width..(v + 1) * width];
        for (v, out) in filtered.chunks_exact_mut(width).enumerate() {
            scale(out, row(v), taps[0]);
            for (step, &tap) in taps.iter().enumerate().skip(1) {
                let (before, after) = (v.saturating_sub(step), (v + step).min(last));
                add_pair(out, row(before), row(after), tap);
            }
        }
    }
}

struct Apply<'a> {
    filter: &'a mut SheetFilter,
    nodes: &'a [Point3<f32>],
    targets: &'a [Point3<f32>],
    out: &'a mut [Point3<f32>],
}

impl pulp::NullaryFnOnce for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let [nodes, targets] = [self.nodes, self.targets].map(bytemuck::cast_slice);
        self.filter
            .take(nodes, targets, bytemuck::cast_slice_mut(self.out));
    }
}

fn next_along_u(grid: GridShape, u: u32, v: u32) -> Option<(u32, u32)> {
    let next = if grid.is_periodic {
        (u + 1) % grid.u_count
    } else {
        u + 1
    };
    (next < grid.u_count).then_some((next, v))
}

fn next_along_v(grid: GridShape, u: u32, v: u32) -> Option<(u32, u32)> {
    (v + 1 < grid.v_count).then_some((u, v + 1))
}

/// Half a Gaussian over whole nodes, both halves together summing to one.
///
/// - `width`: in nodes; `room`: nodes that there are
fn half_gaussian(width: f32, room: usize) -> Vec<f32> {
    if !(width > 0.0 && width.is_finite()) {
        return vec![1.0];
    }
    let reach = ((REACH * width).ceil() as usize)
        .min(MOST_TAPS)
        .min(room.saturating_sub(1));
    let taps: Vec<f32> = (0..=reach)
        .map(|k| (-0.5 * (k as f32 / width).powi(2)).exp())
        .collect();
    let sum = taps[0] + 2.0 * taps[1..].iter().sum::<f32>();
    taps.iter().map(|tap| tap / sum).collect()
}

#[inline(always)]
fn scale(out: &mut [f32], row: &[f32], tap: f32) {
    for (out, x) in out.iter_mut().zip(row) {
        *out = tap * x;
    }
}

/// Both neighbours are added before they are weighed, so that a mirrored patch gives the mirrored
/// bits.
#[inline(always)]
fn add_pair(out: &mut [f32], before: &[f32], after: &[f32], tap: f32) {
    for ((out, a), b) in out.iter_mut().zip(before).zip(after) {
        *out += tap * (a + b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const GRID: GridShape = GridShape {
        u_count: 64,
        v_count: 16,
        is_periodic: false,
    };
    const RING: GridShape = GridShape {
        is_periodic: true,
        ..GRID
    };

    /// Nodes 2 mm apart.
    fn flat(grid: GridShape) -> Vec<Point3<f32>> {
        let node = |i: u32| [i % grid.u_count, i / grid.u_count].map(|k| 2.0 * k as f32);
        (0..grid.node_count() as u32)
            .map(|i| Point3::new(node(i)[0], node(i)[1], 0.0))
            .collect()
    }

    /// Passes `u` through a filter of 3.5 mm with `m` everywhere.
    fn passed(
        grid: GridShape,
        m: f32,
        u: impl Fn(usize, usize) -> Vector3<f32>,
    ) -> Vec<Vector3<f32>> {
        let targets = flat(grid);
        let columns = grid.u_count as usize;
        let nodes: Vec<_> = (0..targets.len())
            .map(|i| targets[i] + u(i % columns, i / columns))
            .collect();
        let mut out = nodes.clone();
        let mut filter = SheetFilter::new(grid, &targets, 3.5, vec![m; nodes.len()]);
        filter.apply(&nodes, &targets, &mut out);
        out.iter().zip(&targets).map(|(p, x)| p - x).collect()
    }

    #[test]
    fn waves_keep_what_a_gaussian_keeps_of_them() {
        // Round a ring there is no edge. Periods of 128 / k mm.
        for waves in [2.0, 4.0, 8.0, 16.0f32] {
            let phase = |u: usize| std::f32::consts::TAU * waves * u as f32 / 64.0;
            let out = passed(RING, 1.0, |u, _| Vector3::z() * phase(u).cos());
            // Along x edges are 2 mm, but for the one that closes the ring of a flat strip.
            let edge = (2.0 * 63.0 + 126.0) / 64.0;
            let sigma = 3.5 / edge * std::f32::consts::TAU * waves / 64.0;
            let expected = (-0.5 * sigma * sigma).exp();
            for u in 0..64 {
                let kept = out[5 * 64 + u].z;
                let error = (kept - expected * phase(u).cos()).abs();
                assert!(error < 0.015, "{waves} waves at {u}: {kept}");
            }
        }
    }

    #[test]
    fn what_moves_as_one_passes_and_folds_do_not() {
        let as_one = passed(GRID, 1.0, |_, _| Vector3::new(1.0, -2.0, 3.0));
        for way in as_one {
            assert!((way - Vector3::new(1.0, -2.0, 3.0)).norm() < 1e-5, "{way}");
        }
        let is_up = |u: usize, v: usize| (u / 2 + v / 2).is_multiple_of(2);
        let sign = |u: usize, v: usize| if is_up(u, v) { 1.0 } else { -1.0 };
        let folds = passed(GRID, 1.0, |u, v| Vector3::z() * sign(u, v));
        for v in 4..12 {
            for u in 4..60 {
                assert!(folds[v * 64 + u].norm() < 0.05);
            }
        }
    }

    #[test]
    fn nothing_grows_and_where_nothing_is_filtered_bits_pass() {
        let wild = |u: usize, v: usize| {
            let at = (u * 31 + v * 17) as f32;
            Vector3::new((at * 1.7).sin(), (at * 2.3).cos(), (at * 0.9).sin())
        };
        for way in passed(GRID, 1.0, wild) {
            assert!(way.amax() <= 1.0 + 1e-4, "{way}");
        }
        let targets = flat(GRID);
        let nodes: Vec<_> = (0..targets.len())
            .map(|i| targets[i] + wild(i % 64, i / 64))
            .collect();
        let mut out = targets.clone();
        SheetFilter::new(GRID, &targets, 3.5, vec![0.0; nodes.len()])
            .apply(&nodes, &targets, &mut out);
        assert_eq!(out, nodes);
        SheetFilter::new(GRID, &targets, 3.5, vec![1.0; nodes.len()])
            .apply(&targets, &targets, &mut out);
        assert_eq!(out, targets);
    }

    #[test]
    fn mirrored_motion_gives_mirrored_bits() {
        let wave = |u: usize, v: usize| Vector3::z() * ((u * u + 3 * v) as f32 * 0.37).sin();
        let one = passed(GRID, 0.7, wave);
        let other = passed(GRID, 0.7, |u, v| wave(63 - u, v));
        for v in 0..16 {
            for u in 0..64 {
                assert_eq!(one[v * 64 + u].z, other[v * 64 + 63 - u].z);
            }
        }
    }

    #[test]
    fn without_width_it_is_idle() {
        let rest = flat(GRID);
        assert!(SheetFilter::new(GRID, &rest, 0.0, vec![1.0; rest.len()]).is_idle());
        assert!(SheetFilter::new(GRID, &rest, 3.5, vec![0.0; rest.len()]).is_idle());
        assert!(!SheetFilter::new(GRID, &rest, 3.5, vec![1.0; rest.len()]).is_idle());
    }
}
