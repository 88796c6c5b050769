//! The state of a group, and how it is made from patches.

use nalgebra::Point3;

use super::anchors::{Anchor, anchors};
use super::descent::Incidence;
use super::floor::Floor;
use super::pairs::PairTable;
use super::sweeps::Multipliers;
use crate::cloth::constraints::grid_lists::GridLists;
use crate::cloth::constraints::magnet::Magnet;
use crate::cloth::constraints::stretch::{RestLengths, edge_length};
use crate::cloth::constraints::wind::Air;
use crate::cloth::input::{
    ClothAttachment, ClothOptions, ClothPatch, Integrator, Mode, NodeVariation,
};
use crate::cloth::materials::Material;
use crate::machine::{Real, Vec3};

/// How much more the lengths of the loosest skin are varied than those of skin that is not loose.
const UNEVENNESS: f64 = 12.0;

/// Displacements further than this are taken for a failure. (mm)
pub(super) const FARTHEST: f64 = 1e5;

/// Per-lane bookkeeping.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LaneState {
    pub(super) has_history: bool,
    pub(super) euler_frames: u32,
    pub(super) robust_frames: u32,
    pub(super) energy: f64,
    pub(super) mismatch: f64,
    /// Whether the end slopes of the last frame came from given velocities.
    pub(super) has_velocity: bool,
}

/// Patches of one shape, side by side.
pub(crate) struct Group<R> {
    pub(super) patches: Vec<usize>,
    pub(super) integrator: Integrator,
    pub(super) mode: Mode,
    pub(super) sweeps: u32,
    pub(super) has_pressure: bool,
    pub(super) has_shear: bool,
    pub(super) has_bend: bool,
    pub(super) has_stretch_damping: bool,
    /// Centre of each patch, which positions are relative to. [mm, head frame]
    pub(super) origin: Vec3<R>,

    pub(super) mass: R,
    pub(super) magnet: Magnet<R>,
    pub(super) damping: R,
    /// Stretch and compression. [mass/s^2]
    pub(super) stretch: [R; 2],
    pub(super) stretch_damping_time: R,
    pub(super) shear: R,
    pub(super) bend: R,
    pub(super) bend_dropoff: R,
    pub(super) pressure: R,
    pub(super) inv_edge_squared: R,
    /// Half the mean edge, squared. [mm^2]
    pub(super) edge_limit_squared: R,
    /// That, or more than any step while a hook has the last word. [mm^2]
    pub(super) clamp_squared: R,
    pub(super) air: Air<R>,
    pub(super) inv_air_mass: R,
    /// Sum of anchor stiffnesses per node. [mass/s^2]
    pub(super) anchor_stiffness: Vec<R>,
    pub(super) anchors: Vec<Anchor<R>>,
    pub(super) pairs: PairTable,
    pub(super) floor: Floor<R>,

    pub(super) lists: GridLists,
    pub(super) edge_lengths: RestLengths<R>,
    pub(super) diagonal_lengths: RestLengths<R>,
    /// Factor of each triple's compliance; empty where all are 1.
    pub(super) bend_softness: Vec<R>,

    pub(super) displacements: Vec<Vec3<R>>,
    pub(super) previous_displacements: Vec<Vec3<R>>,
    pub(super) velocities: Vec<Vec3<R>>,
    pub(super) previous_velocities: Vec<Vec3<R>>,
    /// How far the targets moved in the last substep of the frame before. (mm)
    pub(super) target_steps: Vec<Vec3<R>>,

    /// Hermite segments: chord, slope at the start and at the end, times dt. (mm)
    pub(super) chords: Vec<Vec3<R>>,
    pub(super) start_slopes: Vec<Vec3<R>>,
    pub(super) end_slopes: Vec<Vec3<R>>,
    /// Targets at the end of the frame, relative to the centre. (mm)
    pub(super) ends: Vec<Vec3<R>>,
    /// Velocities of the targets at the end of the frame. (mm/s)
    pub(super) end_velocities: Vec<Vec3<R>>,
    /// Targets at the end of the frame as given. [mm, head frame]
    pub(super) end_positions: Vec<Vec<Point3<f32>>>,

    /// Targets at the end of the substep, or at the start of the frame before there is one,
    /// relative to the centre. (mm)
    pub(super) targets: Vec<Vec3<R>>,
    /// Displacements, then positions, that are being solved for. (mm)
    pub(super) solution: Vec<Vec3<R>>,
    /// x_b - X. (mm)
    pub(super) past: Vec<Vec3<R>>,
    /// X + u_b. (mm)
    pub(super) resting: Vec<Vec3<R>>,
    pub(super) inv_masses: Vec<R>,
    /// What the wind does to every node. (mm/s^2)
    pub(super) wind_accelerations: Vec<Vec3<R>>,
    pub(super) gradient: Vec<Vec3<R>>,
    /// Multipliers, where there are several sweeps.
    pub(super) multipliers: Multipliers<R>,
    /// Constraints by node, inertial target, positions before a pass, and displacements, where
    /// there is a descent.
    pub(super) incidence: Option<Box<Incidence>>,
    pub(super) inertial: Vec<Vec3<R>>,
    pub(super) trial: Vec<Vec3<R>>,
    pub(super) scratch: Vec<Vec3<R>>,

    /// Effective step for which `inv_masses` holds, and how often they have changed.
    pub(super) masses_h_e: R,
    pub(super) masses_version: u64,
    pub(super) h_e: R,
    /// 1/h_e of the substep that is being finished. (1/s)
    pub(super) inv_h: R,
    /// Hermite weights of the targets before and after the substep.
    pub(super) weights: [[f64; 3]; 2],
    pub(super) clamped: R,
    pub(super) drive: R,
    pub(super) mismatch: R,
    /// Sum of squared displacements at the end of the frame. [mm^2]
    pub(super) squared_distance: R,
    pub(super) lane_states: Vec<LaneState>,
}

impl<R: Real> Group<R> {
    /// A group of `patches` (indices into `all`), at rest.
    pub(crate) fn new(all: &[ClothPatch], patches: &[usize], options: &ClothOptions) -> Self {
        let shape = all[patches[0]].shape;
        let n = shape.node_count();
        // Lanes to spare repeat the last patch, so that their arithmetic is sound too.
        let of_lane = |lane: usize| patches[lane.min(patches.len() - 1)];
        let per_lane = |value: &dyn Fn(&ClothPatch) -> f64| {
            let mut out = R::splat(0.0);
            for lane in 0..R::LANES {
                out.set_lane(lane, value(&all[of_lane(lane)]));
            }
            out
        };
        let zero = vec![Vec3::<R>::zero(); n];
        let mut origin = Vec3::zero();
        let mut rest = zero.clone();
        for lane in 0..R::LANES {
            let nodes = &all[of_lane(lane)].rest;
            let mut sum = [0.0; 3];
            for p in nodes {
                for axis in 0..3 {
                    sum[axis] += f64::from(p[axis]);
                }
            }
            // Whole millimetres: exact in any precision, and a mirrored patch has the
            // mirrored centre.
            let center = sum.map(|s| (s / n as f64).round());
            origin.set_lane(lane, center);
            for (local, p) in rest.iter_mut().zip(nodes) {
                local.set_lane(lane, relative(p, center));
            }
        }
        let lists = GridLists::new(shape);
        let mean_edge = mean_edge(&lists.edges, &rest);
        let (anchors, anchor_stiffness) = anchors(all, patches, &rest);
        // What the variations of a constraint's nodes come to, lane by lane.
        let varied = |nodes: &[u32], factor: fn(&NodeVariation) -> f32| {
            per_lane(&|p: &ClothPatch| mean_factor(&p.variations, nodes, factor))
        };
        let lengths = |edges: &[[u32; 2]]| -> RestLengths<R> {
            let blend = edges.iter().map(|edge| {
                let noise = edge_noise(options.seed, edge[0], edge[1]);
                let own = varied(edge, |v| v.rest_blend);
                let (zero, one) = (R::splat(0.0), R::splat(1.0));
                // Skin is the less even the looser it is: there the seed decides how it folds.
                let share = R::splat(options.rest_blend) + (one - own) * R::splat(UNEVENNESS);
                let astray = share * R::splat(options.rest_imperfection * noise);
                let blend = R::splat(options.rest_blend) * own + astray;
                let blend = R::select_less(blend, one, blend, one);
                R::select_less(zero, blend, blend, zero)
            });
            RestLengths::new(&rest, edges, blend.collect())
        };
        let softness = |of: &mut dyn Iterator<Item = &[u32]>, factor| -> Vec<R> {
            let is_varied = patches.iter().any(|&p| !all[p].variations.is_empty());
            of.filter(|_| is_varied)
                .map(|nodes| R::splat(1.0) / varied(nodes, factor))
                .collect()
        };
        let stretch_softness = |edges: &[[u32; 2]]| {
            softness(&mut edges.iter().map(<[u32; 2]>::as_slice), |v| v.stretch)
        };
        let bend_softness = softness(&mut lists.triples.iter().map(<[u32; 3]>::as_slice), |v| {
            v.bend
        });
        let edge_lengths = lengths(&lists.edges).with_softness(stretch_softness(&lists.edges));
        let diagonal_lengths =
            lengths(&lists.diagonals).with_softness(stretch_softness(&lists.diagonals));
        let has = |number: &dyn Fn(&Material) -> f64| {
            patches.iter().any(|&p| number(&all[p].material) > 0.0)
        };
        // A grid without edges has no measure to hold displacements to.
        let edge_limit_squared = R::select_less(
            R::splat(0.0),
            mean_edge,
            mean_edge * mean_edge * R::splat(0.25),
            R::splat(FARTHEST * FARTHEST),
        );
        Self {
            patches: patches.to_vec(),
            integrator: options.integrator,
            mode: options.mode,
            sweeps: options.sweeps,
            has_pressure: has(&|m| m.pressure),
            has_shear: has(&|m| m.shear_resistance),
            has_bend: has(&|m| m.bend_resistance),
            has_stretch_damping: has(&|m| m.stretch_damping),
            origin,
            mass: per_lane(&|p| p.material.mass),
            magnet: Magnet {
                stiffness: per_lane(&|p| p.material.magnet_stiffness()),
                damping: per_lane(&|p| p.material.magnet_damping()),
            },
            damping: per_lane(&|p| p.material.damping),
            stretch: [
                per_lane(&|p| p.material.stretch_stiffness()),
                per_lane(&|p| p.material.compression_stiffness()),
            ],
            stretch_damping_time: per_lane(&|p| p.material.stretch_damping_time()),
            shear: per_lane(&|p| p.material.shear_stiffness()),
            bend: per_lane(&|p| p.material.bend_stiffness()),
            bend_dropoff: per_lane(&|p| p.material.bend_angle_dropoff),
            pressure: per_lane(&|p| p.material.pressure_stiffness(n, p.area())),
            inv_edge_squared: R::splat(1.0) / (mean_edge * mean_edge).max(R::splat(1e-12)),
            clamp_squared: edge_limit_squared,
            edge_limit_squared,
            air: Air {
                density: R::splat(options.air_density),
                drag: R::splat(options.drag),
                lift: R::splat(options.lift),
            },
            inv_air_mass: per_lane(&|p| {
                n as f64 / (options.areal_density * p.material.mass * p.area()).max(1e-12)
            }),
            anchor_stiffness,
            anchors,
            pairs: PairTable::default(),
            floor: Floor::none(n),
            edge_lengths,
            diagonal_lengths,
            bend_softness,
            lists,
            displacements: zero.clone(),
            previous_displacements: zero.clone(),
            velocities: zero.clone(),
            previous_velocities: zero.clone(),
            target_steps: zero.clone(),
            chords: zero.clone(),
            start_slopes: zero.clone(),
            end_slopes: zero.clone(),
            end_velocities: zero.clone(),
            end_positions: (0..patches.len())
                .map(|lane| all[patches[lane]].rest.clone())
                .collect(),
            targets: rest.clone(),
            ends: rest,
            solution: zero.clone(),
            past: zero.clone(),
            resting: zero.clone(),
            inv_masses: vec![R::splat(0.0); n],
            wind_accelerations: zero.clone(),
            multipliers: Multipliers::default(),
            incidence: None,
            inertial: Vec::new(),
            trial: Vec::new(),
            scratch: zero.clone(),
            gradient: zero,
            masses_h_e: R::splat(-1.0),
            masses_version: 0,
            h_e: R::splat(0.0),
            inv_h: R::splat(0.0),
            weights: [[0.0; 3]; 2],
            clamped: R::splat(0.0),
            drive: R::splat(0.0),
            mismatch: R::splat(0.0),
            squared_distance: R::splat(0.0),
            lane_states: vec![LaneState::default(); R::LANES],
        }
    }
}

impl ClothPatch {
    /// Area at rest. [mm^2]
    pub(crate) fn area(&self) -> f64 {
        let at = |i: u32| self.rest[i as usize].map(f64::from);
        self.shape
            .quads()
            .iter()
            .map(|&[a, b, c, d]| (at(c) - at(a)).cross(&(at(d) - at(b))).norm() / 2.0)
            .sum()
    }

    /// Nodes and strength of each set of anchors, in order.
    pub(crate) fn anchor_sets(&self) -> impl Iterator<Item = (&[u32], f64)> {
        self.attachments.iter().filter_map(|a| match a {
            ClothAttachment::Anchors { nodes, strength } => Some((nodes.as_slice(), *strength)),
            _ => None,
        })
    }
}

/// Mean of a factor over some nodes of a patch; 1 where the patch has no variations.
fn mean_factor(
    variations: &[NodeVariation],
    nodes: &[u32],
    factor: fn(&NodeVariation) -> f32,
) -> f64 {
    if variations.is_empty() {
        return 1.0;
    }
    let sum: f64 = nodes
        .iter()
        .map(|&i| f64::from(factor(&variations[i as usize])))
        .sum();
    sum / nodes.len() as f64
}

/// A position relative to a centre.
pub(super) fn relative(p: &Point3<f32>, center: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from(p[axis]) - center[axis])
}

/// Mean length of the grid's edges. (mm)
fn mean_edge<R: Real>(edges: &[[u32; 2]], positions: &[Vec3<R>]) -> R {
    let mut sum = R::splat(0.0);
    for &[i, j] in edges {
        sum += edge_length(positions[i as usize], positions[j as usize]);
    }
    sum / R::splat(edges.len().max(1) as f64)
}

/// Noise in [-1, 1] for the edge of two nodes, the same in every patch (SplitMix64's
/// finalizer).
fn edge_noise(seed: u64, i: u32, j: u32) -> f64 {
    let edge = (u64::from(i) << 32) | u64::from(j);
    let mut z = seed
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add((edge + 1).wrapping_mul(0xBF58_476D_1CE4_E5B9));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
