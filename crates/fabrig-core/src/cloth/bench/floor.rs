//! The floor: what the constraints alone cost while everything is in the nearest cache.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::scene::BenchScene;
use crate::anatomy::GridShape;
use crate::cloth::ClothPatch;
use crate::cloth::constraints::bend::{BendCompliance, project_bend};
use crate::cloth::constraints::grid_lists::GridLists;
use crate::cloth::constraints::shear::project_shear;
use crate::cloth::constraints::stretch::{RestLengths, StretchCompliance, project_stretch};
use crate::machine::{F32x8, Real, Vec3, vectorized};

/// Sweeps in one timing.
const SWEEPS: usize = 64;

/// Timings; the least counts.
const TIMINGS: usize = 25;

/// What the bare kernels cost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Floor {
    /// Constraints of the scene: edges, diagonals and triples of all patches.
    pub constraint_count: usize,
    /// One constraint of one patch in full lanes, in cache. (ns)
    pub ns_per_constraint: f64,
    /// Lanes it ran in.
    pub lane_count: usize,
}

impl Floor {
    /// A frame of `substeps` with `sweeps` each on one thread, if it cost nothing else. (ms)
    pub fn frame_ms(&self, substeps: u32, sweeps: u32) -> f64 {
        let projections = self.constraint_count as f64 * f64::from(substeps * sweeps);
        projections * self.ns_per_constraint * 1e-6
    }
}

/// Edges, diagonals and triples of a patch.
pub fn constraint_count(patch: &ClothPatch) -> usize {
    let lists = GridLists::new(patch.shape);
    lists.edges.len() + lists.diagonals.len() + lists.triples.len()
}

/// Measures the floor of a scene on a group of the default patch size, 21 x 20.
pub fn floor(scene: &BenchScene) -> Floor {
    type Lanes = F32x8;
    let mut kernel = BareGroup::<Lanes>::new();
    let count =
        kernel.lists.edges.len() + kernel.lists.diagonals.len() + kernel.lists.triples.len();
    let mut least = f64::INFINITY;
    for _ in 0..TIMINGS {
        let clock = Instant::now();
        vectorized(Sweeps(&mut kernel));
        least = least.min(clock.elapsed().as_secs_f64());
    }
    let projections = (SWEEPS * count * Lanes::LANES) as f64;
    Floor {
        constraint_count: scene.patches.iter().map(constraint_count).sum(),
        ns_per_constraint: least * 1e9 / projections,
        lane_count: Lanes::LANES,
    }
}

/// Positions and constraints of full lanes, and nothing else.
struct BareGroup<R> {
    lists: GridLists,
    displacements: Vec<Vec3<R>>,
    positions: Vec<Vec3<R>>,
    resting: Vec<Vec3<R>>,
    inv_masses: Vec<R>,
    edge_lengths: RestLengths<R>,
    diagonal_lengths: RestLengths<R>,
}

impl<R: Real> BareGroup<R> {
    fn new() -> Self {
        let shape = GridShape {
            u_count: 21,
            v_count: 20,
            is_periodic: false,
        };
        let lists = GridLists::new(shape);
        let nodes = shape.node_count();
        let at = |i: usize| {
            let (u, v) = ((i % 21) as f64, (i / 21) as f64);
            [2.0 * u + 0.1 * v.sin(), 2.0 * v, (0.3 * u).cos()]
        };
        let positions: Vec<Vec3<R>> = (0..nodes).map(|i| Vec3::splat(at(i))).collect();
        let blend = |count: usize| vec![R::splat(0.9); count];
        Self {
            edge_lengths: RestLengths::new(&positions, &lists.edges, blend(lists.edges.len())),
            diagonal_lengths: RestLengths::new(
                &positions,
                &lists.diagonals,
                blend(lists.diagonals.len()),
            ),
            displacements: (0..nodes)
                .map(|i| Vec3::splat([0.1 * (i as f64).sin(), 0.0, 0.05 * (i as f64).cos()]))
                .collect(),
            resting: positions.clone(),
            inv_masses: vec![R::splat(0.9); nodes],
            positions,
            lists,
        }
    }
}

/// Sweeps over a bare group, compiled for the processor's vectors.
struct Sweeps<'a, R>(&'a mut BareGroup<R>);

impl<R: Real> pulp::NullaryFnOnce for Sweeps<'_, R> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let g = self.0;
        let stretch = StretchCompliance {
            stretch: R::splat(0.5),
            compression: R::splat(0.5),
            gamma: R::splat(0.1),
        };
        let bend = BendCompliance {
            compliance: R::splat(3.0),
            dropoff: R::splat(0.3),
            inv_edge_squared: R::splat(0.25),
        };
        let half = R::splat(0.5);
        for _ in 0..SWEEPS {
            project_bend::<R, false>(
                &g.lists.triples,
                &mut g.displacements,
                &g.inv_masses,
                &bend,
                &[],
            );
            project_shear::<R, false>(
                &g.lists.diagonals,
                &mut g.positions,
                &g.inv_masses,
                g.diagonal_lengths.part(0..g.lists.diagonals.len()),
                half,
                half,
            );
            project_stretch::<R, true, false>(
                &g.lists.edges,
                &mut g.positions,
                &g.inv_masses,
                g.edge_lengths.part(0..g.lists.edges.len()),
                &g.resting,
                half,
                &stretch,
            );
        }
    }
}
